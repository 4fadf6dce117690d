"""From paths to loops."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.intake.loop import Loop
from stiction_ros.intake.options import IntakeOptions
from stiction_ros.records.open_record import open_parts


def loops(paths: Sequence[Path], options: IntakeOptions) -> Iterator[Loop]:
    """Yield the loops that files and folders hold, read one after the other.

    A loop that cannot be read comes with its ``problem`` and stops no other.

    Args:
        paths: files and folders, read in their order; folders by the names in them.
        options: how to read them.
    """
    for path in paths:
        for file in sorted(path.glob("*.csv")) if path.is_dir() else [path]:
            yield _loop(file, options)


def _loop(file: Path, options: IntakeOptions) -> Loop:
    try:
        parts = open_parts(file, options.columns, namespace=options.namespace)
    except InputError as error:
        return Loop(file.stem, (file,), (), problem=str(error))
    notes = tuple(dict.fromkeys(note for part in parts for note in part.notes))
    return Loop(file.stem, (file,), parts, notes)
