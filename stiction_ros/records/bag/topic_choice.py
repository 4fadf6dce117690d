"""Which topics a recorder takes."""

import re
from collections.abc import Callable, Sequence

from stiction_ros.errors import InputError

OWN = "own"  # in place of an expression: topics of the recorder's namespace and of the graph

GLOBAL = ("clock", "diagnostics", "parameter_events", "rosout")


def topic_choice(
    names: Sequence[str], regex: str, exclude: str, namespace: str = "/"
) -> Callable[[str], bool]:
    """Return what tells whether a topic is taken; an empty expression fits nothing.

    Args:
        names: full names.
        regex: of full names; :data:`OWN` for the loop of the namespace.
        exclude: of full names that are left out, also when ``names`` has them.
        namespace: of the recorder.
    """
    if not names and not regex:
        raise InputError("no topic is chosen", where="recorder", fix="set topics or regex")
    if regex == OWN:
        own = re.escape(namespace.rstrip("/"))
        regex = f"{own}/.*|/({'|'.join(GLOBAL)})" if own else ".*"
    fits, left_out = _fitting(regex, "regex"), _fitting(exclude, "exclude_regex")
    return lambda topic: not left_out(topic) and (topic in names or bool(fits(topic)))


def _fitting(text: str, key: str) -> Callable[[str], re.Match[str] | None]:
    try:
        return re.compile(text).fullmatch if text else lambda _: None
    except re.error as error:
        raise InputError(f"no regular expression ({error})", where=f"recorder: {key}") from None
