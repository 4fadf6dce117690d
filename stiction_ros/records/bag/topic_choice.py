"""Which topics a recorder takes."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence

from stiction_ros.errors import InputError

OWN = "own"
"""Instead of an expression: the topics of the recorder's namespace and those of the graph."""

GLOBAL = ("clock", "diagnostics", "parameter_events", "rosout")


@dataclasses.dataclass(frozen=True)
class TopicChoice:
    """A list of names and two regular expressions.

    Attributes:
        names: full names that are wanted in any case.
        regex: of the full names that are wanted, None for none.
        exclude: of the full names that are left out, also when ``names`` has them.
    """

    names: frozenset[str]
    regex: re.Pattern[str] | None
    exclude: re.Pattern[str] | None

    @classmethod
    def of(
        cls, names: Sequence[str], regex: str, exclude: str, namespace: str = "/"
    ) -> TopicChoice:
        """Build a choice from what parameters say; an empty expression fits nothing.

        Args:
            names: full names.
            regex: of full names; :data:`OWN` for the loop of the namespace.
            exclude: of full names.
            namespace: of the recorder.

        Raises:
            InputError: no regular expression, or nothing is chosen at all.
        """
        if not names and not regex:
            raise InputError("no topic is chosen", where="recorder", fix="set topics or regex")
        if regex == OWN:
            own = re.escape(namespace.rstrip("/"))
            regex = f"{own}/.*|/({'|'.join(GLOBAL)})" if own else ".*"
        return cls(frozenset(names), _compiled(regex, "regex"), _compiled(exclude, "exclude_regex"))

    def __contains__(self, topic: str) -> bool:
        if self.exclude is not None and self.exclude.fullmatch(topic):
            return False
        return topic in self.names or (self.regex is not None and bool(self.regex.fullmatch(topic)))


def _compiled(text: str, key: str) -> re.Pattern[str] | None:
    try:
        return re.compile(text) if text else None
    except re.error as error:
        raise InputError(f"no regular expression ({error})", where=f"recorder: {key}") from None
