"""Parameter files named on the command line: read before ROS does, so that errors are one line."""

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from stiction_ros.errors import InputError

KEY = "ros__parameters"


def given(arguments: Sequence[str]) -> list[str]:
    """Return the files behind ``--params-file``."""
    return [value for name, value in itertools.pairwise(arguments) if name == "--params-file"]


def node_keys(path: str) -> list[str]:
    """Return the patterns of node names in a parameter file, such as ``/**/plant``.

    Raises:
        InputError: the file cannot be read, or holds no parameters of a node.
    """
    try:
        document = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=path) from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        said = " ".join(str(error).split())
        raise InputError(f"is not YAML ({said})", where=path) from None
    if not isinstance(document, Mapping):
        raise InputError(f"has no {KEY}", where=path, fix=f"write NODE: {{{KEY}: {{…}}}}")
    keys = list(_keys(document, ""))
    if not keys:
        raise InputError(f"has no {KEY}", where=path, fix=f"write NODE: {{{KEY}: {{…}}}}")
    return keys


def applies(key: str, node: str) -> bool:
    """Tell whether the parameters under ``key`` go to ``node``, such as ``/unit1/plant``.

    ``*`` stands for one part of the name, ``**`` for any number of parts; a key without a
    leading slash begins at the root.
    """
    pattern = ""
    for part in key.strip("/").split("/"):
        if part == "**":
            pattern += "(/[^/]+)*"
        else:
            pattern += "/" + "[^/]*".join(re.escape(piece) for piece in part.split("*"))
    return re.fullmatch(pattern, node) is not None


def unused(path: str, node: str) -> str:
    """Return a warning when nothing in the file goes to ``node``, else an empty text.

    Raises:
        InputError: as :func:`node_keys`.
    """
    keys = node_keys(path)
    if any(applies(key, node) for key in keys):
        return ""
    name = node.rpartition("/")[2]
    return (
        f"{path} holds nothing for {node}, only for {', '.join(keys)}; "
        f"name it {node} or /**/{name} there"
    )


def _keys(document: Mapping[Any, Any], above: str) -> Iterator[str]:
    for name, value in document.items():
        if not isinstance(value, Mapping):
            continue
        key = f"{above}/{str(name).strip('/')}" if above else str(name)
        if KEY in value:
            yield key
        yield from _keys({n: v for n, v in value.items() if n != KEY}, key)
