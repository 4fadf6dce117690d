"""What benches over many seeds share: which seeds, and a log of every loop that was judged."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from stiction_ros.errors import InputError, storing

Row = TypeVar("Row")


def check_seeds(first: int, loops: int) -> None:
    """Check the first seed and the number of loops.

    Raises:
        InputError: no loop at all, or a negative seed.
    """
    if loops < 1:
        raise InputError(f"{loops} loops", where="--loops", fix="use 1 up")
    if first < 0:
        raise InputError(f"{first} is negative", where="--first")


def start_log(path: Path) -> None:
    """Begin an empty log."""
    with storing(path):
        path.write_text("", encoding="utf-8")


def logged_rows(path: Path, full: bool, row_of: Callable[[Mapping[str, Any]], Row]) -> list[Row]:
    """Return the rows of a log, a JSON mapping a line; none where there is no log.

    Args:
        path: of the log.
        full: only rows that say so of themselves are returned.
        row_of: makes a row of the rest of a line.

    Raises:
        InputError: a line that is no row.
    """
    if not path.exists():
        return []
    rows = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            values = json.loads(line)
            if bool(values.pop("full")) == full:
                rows.append(row_of(values))
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(
                f"line {number} is no row of this benchmark ({error})",
                where=str(path),
                fix="choose another --log, or leave --resume out",
            ) from None
    return rows
