"""What both suites of faults do with a case: keep what it left, and write its times."""

import shutil
from pathlib import Path

from stiction_ros.errors import storing


def keep(folder: Path, target: Path) -> None:
    """Copy what a case has left in ``folder`` to ``target``; what was there before goes.

    Raises:
        InputError: the target cannot be written.
    """
    with storing(target):
        if target.exists():
            shutil.rmtree(target)
        shutil.copytree(folder, target)


def shown_seconds(value: float | None) -> str:
    """Return ``value``, s, as the tables show it; a dash for None."""
    return "–" if value is None else f"{value:.1f}"
