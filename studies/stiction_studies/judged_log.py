"""A log of every loop that a bench judged."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from stiction_ros.errors import InputError, storing
from stiction_ros.texts import json_text

Row = TypeVar("Row")


def start_log(path: Path) -> None:
    """Begin an empty log."""
    with storing(path):
        path.write_text("", encoding="utf-8")


def keep_row(path: Path, full: bool, row: Mapping[str, Any]) -> None:
    """Add a row to a log in one write: workers share the file."""
    line = json_text({"full": full} | dict(row), indent=None) + "\n"
    with storing(path), path.open("ab", buffering=0) as file:
        file.write(line.encode())


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
