"""Where configuration files are found: as given, else among those that come along."""

import os
import sys
from pathlib import Path

from stiction_ros.errors import InputError


def installation_prefixes() -> tuple[str, ...]:
    """Return where ROS packages are installed: ``AMENT_PREFIX_PATH``, then Python's own prefix."""
    listed = [part for part in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if part]
    return tuple(dict.fromkeys([*listed, sys.prefix]))


def config_directories() -> list[Path]:
    """Return the folders with the package's own configuration, nearest first."""
    candidates = [Path(__file__).resolve().parents[1] / "config"]
    shares = [Path(prefix) / "share" for prefix in installation_prefixes()]
    candidates += [share / "stiction_ros" / "config" for share in shares]
    return [path for path in candidates if path.is_dir()]


def find_config(name: str | Path) -> Path:
    """Return ``name`` if it exists, else the file of that name that comes with the package.

    Raises:
        InputError: neither exists.

    Args:
        name: a path, or the name of a file that comes with the package.

    Examples:
        >>> from stiction_ros import find_config
        >>> find_config("flow.loop.yaml").name
        'flow.loop.yaml'
    """
    path = Path(name)
    if path.is_file():
        return path
    if not path.is_absolute():
        for directory in config_directories():
            if (directory / path).is_file():
                return directory / path
    known = sorted({p.name for d in config_directories() for p in d.glob("*.yaml")})
    raise InputError(
        "no such file",
        where=str(path),
        fix=f"give a path, or one of those that come along: {', '.join(known)}",
    )
