"""A list that says which tags make up which loop."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import OpUnit
from stiction_ros.intake.sheets.names import Tag
from stiction_ros.intake.tables.tag_rows import TagRow, read_rows


@dataclasses.dataclass(frozen=True)
class TagList:
    """Which tags make up which loop.

    Attributes:
        loops: name of the loop, signal, for each tag in small letters.
        units: unit of OP of loops of which the list says it.
        rows: rows that count for one file alone, by its name.
        own: in the list of a file the tags that its rows name, by their small letters.
    """

    loops: Mapping[str, Tag]
    units: Mapping[str, OpUnit] = dataclasses.field(default_factory=dict)
    rows: Mapping[str, Sequence[TagRow]] = dataclasses.field(default_factory=dict)
    own: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def read(self, name: str) -> Tag | None:
        """Return what a tag is, None when the list does not have it."""
        return self.loops.get(_key(name))

    def of_file(self, path: Path) -> TagList | None:
        """Return the list for one file, its own rows first; None when nothing is in it.

        Raises:
            InputError: its rows have a tag twice.
        """
        rows = self.rows_of(path)
        if not rows and self.loops:
            return self
        own = {_key(tag): tag for row in rows for _, tag in row.tags}
        loops = {**self.loops, **_by_tag(rows)}
        return TagList(loops, self.units, own=own) if loops or self.units else None

    def rows_of(self, path: Path) -> list[TagRow]:
        """Return the rows that count for one file alone."""
        return [row for row in self.rows.get(path.name, ()) if row.names(path)]

    def refuse_ambiguous(self, files: Sequence[Path]) -> None:
        """Raise where a row names several files.

        Raises:
            InputError: it does, and its line.
        """
        taken: dict[str, Path] = {}
        for file in files:
            for row in self.rows_of(file):
                if taken.setdefault(row.where, file) != file:
                    raise InputError(
                        f"{row.file} may be {taken[row.where]} or {file}",
                        where=row.where,
                        fix="write more of its path in the column file",
                    )

    def strange(self, files: Sequence[Path]) -> list[str]:
        """Return the files of rows that are none of ``files``."""
        there = {row.file for file in files for row in self.rows_of(file)}
        named = dict.fromkeys(row.file for rows in self.rows.values() for row in rows)
        return [file for file in named if file not in there]


def read_tag_list(path: Path) -> TagList:
    """Read a table with a row a loop (``loop,pv,sp,op,mode``) or a tag (``tag,loop,signal``).

    A column ``op_unit`` may say ``percent``, ``share`` or ``ma``. A row with a ``file`` counts
    for that file alone, and may have ``time``, ``dates``, ``time_unit`` and ``sample_time``.
    Other columns are ignored.

    Raises:
        InputError: it cannot be read, has other columns, or a tag twice.
    """
    rows = read_rows(path)
    general = [row for row in rows if not row.file]
    of_files: dict[str, list[TagRow]] = {}
    for row in rows:
        if row.file:
            of_files.setdefault(row.file_name, []).append(row)
    return TagList(
        _by_tag(general),
        {row.loop: row.unit for row in general if row.unit is not None},
        of_files,
    )


def _by_tag(rows: Sequence[TagRow]) -> dict[str, Tag]:
    found: dict[str, Tag] = {}
    for row in rows:
        for signal, tag in row.tags:
            key, told = _key(tag), Tag(row.loop, signal)
            if found.setdefault(key, told) != told:
                fix = "list it once" if row.file else "list it once, or with the file of each"
                raise InputError(f"tag {tag} is there twice", where=row.where, fix=fix)
    return found


def _key(name: str) -> str:
    return " ".join(name.split()).casefold()
