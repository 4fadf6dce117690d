"""How one file is read: what a tag list says of it before what is said of all."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import CsvColumns, IntakeOptions, OpUnit
from stiction_ros.intake.tables.tag_rows import TagRow
from stiction_ros.intake.tables.tags import TagList


@dataclasses.dataclass(frozen=True)
class FileWay:
    """How one file is read.

    Attributes:
        options: for this file.
        tags: that make up its loops; None finds them by their names.
        units: of OP of its loops, said of this file; they count before the options.
    """

    options: IntakeOptions
    tags: TagList | None = None
    units: Mapping[str, OpUnit] = dataclasses.field(default_factory=dict)

    def op_unit(self, loop: str, *, single: bool) -> OpUnit | None:
        """Return the unit of OP that is said of a loop; None takes it from the export.

        Args:
            loop: its name.
            single: whether it is the only one of its file, whatever it is called.
        """
        own = self.units.get(loop)
        if own is None and single and len(self.units) == 1:
            own = next(iter(self.units.values()))
        listed = None if self.tags is None else self.tags.units.get(loop)
        return own or self.options.op_unit or listed


def way_of(path: Path, options: IntakeOptions, tags: TagList | None) -> FileWay:
    """Return how a file is read.

    Args:
        path: of the file.
        options: for all files.
        tags: the tag list, if there is one.

    Raises:
        InputError: the rows of the file contradict each other.
    """
    if tags is None:
        return FileWay(options)
    rows = tags.rows_of(path)
    said = _said(rows)
    columns = CsvColumns() if any(row.tags for row in rows) else options.columns
    time = said.pop("time", options.columns.time)
    options = dataclasses.replace(
        options,
        columns=dataclasses.replace(columns, time=time),  # type: ignore[arg-type]
        **said,  # type: ignore[arg-type]
    )
    units = {row.loop: row.unit for row in rows if row.loop and row.unit is not None}
    return FileWay(options, tags.of_file(path), units)


def _said(rows: Sequence[TagRow]) -> dict[str, object]:
    """Return what rows say of their file.

    Raises:
        InputError: one says another thing than a row above it.
    """
    said: dict[str, object] = {}
    for row in rows:
        for key, value in row.options.items():
            if said.setdefault(key, value) != value:
                raise InputError(
                    f"{key} of {row.file} is {value} here and {said[key]} above",
                    where=row.where,
                    fix="say one of them",
                )
    return said
