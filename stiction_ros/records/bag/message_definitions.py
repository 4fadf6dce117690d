"""Finds the definitions and hashes of ROS messages among the installed packages."""

import functools
import json
import re
from collections.abc import Sequence
from pathlib import Path

from stiction_ros.config_files import installation_prefixes
from stiction_ros.errors import InputError


def definition(type_name: str) -> tuple[str, str]:
    """Return the definition of a message, as ``sensor_msgs/msg/JointState``, and its hash.

    It is the text of the ``.msg`` file followed by those it needs, each after a line of 80 ``=``
    and ``MSG: package/Name``; the hash is ``RIHS01_…``. The file of hashes beside a message names
    all that it needs.

    Raises:
        InputError: no such message under :func:`installation_prefixes`.
    """
    return _definition(type_name, installation_prefixes())


@functools.lru_cache(maxsize=256)
def _definition(type_name: str, prefixes: tuple[str, ...]) -> tuple[str, str]:
    path = _find(type_name, prefixes)
    beside = path.with_suffix(".json")
    try:
        told = json.loads(beside.read_text(encoding="utf-8"))["type_hashes"]
        hashes = {str(one["type_name"]): str(one["hash_string"]) for one in told}
        own = hashes.pop(type_name)
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(
            f"no type hash of {type_name}", where=str(beside), fix="reinstall its package"
        ) from None
    parts = [path.read_text(encoding="utf-8")]
    for other in hashes:
        text = _find(other, prefixes).read_text(encoding="utf-8")
        parts.append(f"MSG: {other.replace('/msg/', '/')}\n{text}")
    return ("\n" + "=" * 80 + "\n").join(parts), own


def _find(type_name: str, prefixes: Sequence[str]) -> Path:
    if not re.fullmatch(r"\w+/msg/\w+", type_name):
        raise InputError(f"{type_name!r} is no message type", fix="write it as package/msg/Name")
    for prefix in prefixes:
        path = Path(prefix) / "share" / f"{type_name}.msg"
        if path.is_file():
            return path
    package = type_name.partition("/")[0]
    raise InputError(
        f"no definition of {type_name} under {', '.join(prefixes) or 'no prefix'}",
        fix=f"install {package} or set AMENT_PREFIX_PATH to where it is",
    )
