"""Finds the definitions and hashes of ROS messages among the installed packages."""

import functools
import json
import os
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from stiction_ros.errors import InputError

_BUILTIN = {"bool", "byte", "char", "float32", "float64", "string", "wstring"} | {
    f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
}
_TYPE = re.compile(r"^(?P<package>\w+)/(?:msg/)?(?P<name>\w+)$")
_FIELD = re.compile(r"^(?P<type>[A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+\w+")


def default_prefixes() -> tuple[str, ...]:
    """Return the installation prefixes: ``AMENT_PREFIX_PATH``, then Python's own."""
    listed = [part for part in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if part]
    return tuple(dict.fromkeys([*listed, sys.prefix]))


def definition(type_name: str) -> tuple[str, str]:
    """Return the definition of a message, as ``sensor_msgs/msg/JointState``, and its hash.

    It is the text of the ``.msg`` file followed by those it needs, each after a line of 80 ``=``
    and ``MSG: package/Name``; the hash is ``RIHS01_…``.

    Raises:
        InputError: no such message under :func:`default_prefixes`.
    """
    return _definition(type_name, default_prefixes())


@functools.lru_cache(maxsize=256)
def _definition(type_name: str, prefixes: tuple[str, ...]) -> tuple[str, str]:
    package, name = _split(type_name)
    root = _find(package, name, prefixes)
    texts = {(package, name): _text(root)}
    waiting = list(_dependencies(package, texts[package, name]))
    while waiting:
        key = waiting.pop(0)
        if key not in texts:
            texts[key] = _text(_find(*key, prefixes))
            waiting = [*_dependencies(key[0], texts[key]), *waiting]
    parts = [
        text if key == (package, name) else f"MSG: {key[0]}/{key[1]}\n{text}"
        for key, text in texts.items()
    ]
    return ("\n" + "=" * 80 + "\n").join(parts), _hash(root, f"{package}/msg/{name}")


def _split(type_name: str) -> tuple[str, str]:
    match = _TYPE.match(type_name)
    if match is None:
        raise InputError(f"{type_name!r} is no message type", fix="write it as package/msg/Name")
    return match["package"], match["name"]


def _find(package: str, name: str, prefixes: Sequence[str]) -> Path:
    for prefix in prefixes:
        path = Path(prefix) / "share" / package / "msg" / f"{name}.msg"
        if path.is_file():
            return path
    raise InputError(
        f"no definition of {package}/msg/{name} under {', '.join(prefixes) or 'no prefix'}",
        fix=f"install {package} or set AMENT_PREFIX_PATH to where it is",
    )


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def _dependencies(package: str, text: str) -> Iterator[tuple[str, str]]:
    """Yield package and name of the messages that fields of ``text`` are made of."""
    for line in text.splitlines():
        match = _FIELD.match(line.split("#", 1)[0].strip())
        if match is None or match["type"] in _BUILTIN:
            continue
        yield _split(match["type"] if "/" in match["type"] else f"{package}/{match['type']}")


def _hash(path: Path, type_name: str) -> str:
    """Return the type's hash from the file beside its definition."""
    beside = path.with_suffix(".json")
    try:
        hashes = json.loads(beside.read_text(encoding="utf-8"))["type_hashes"]
        return next(str(h["hash_string"]) for h in hashes if h["type_name"] == type_name)
    except (OSError, ValueError, KeyError, TypeError, StopIteration):
        raise InputError(
            f"no type hash of {type_name}", where=str(beside), fix="reinstall its package"
        ) from None
