"""A list that says which tags make up which loop."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.intake.options import OpUnit, op_unit
from stiction_ros.intake.sheets.cells import Words
from stiction_ros.intake.sheets.names import SIGNAL_WORDS, SIGNALS, Tag
from stiction_ros.intake.sheets.typed import open_sheets


@dataclasses.dataclass(frozen=True)
class TagList:
    """Which tags make up which loop.

    Attributes:
        loops: name of the loop, signal, for each tag in small letters.
        units: unit of OP of loops of which the list says it.
    """

    loops: Mapping[str, Tag]
    units: Mapping[str, OpUnit] = dataclasses.field(default_factory=dict)

    def read(self, name: str) -> Tag | None:
        """Return what a tag is, None when the list does not have it."""
        return self.loops.get(" ".join(name.split()).casefold())


def read_tag_list(path: Path) -> TagList:
    """Read a table with a row a loop (``loop,pv,sp,op,mode``) or a tag (``tag,loop,signal``).

    A column ``op_unit`` may say ``percent``, ``share`` or ``ma``. Other columns are ignored.

    Raises:
        InputError: it cannot be read, has other columns, or a tag twice.
    """
    sheet = open_sheets(path)[0]
    header = [name.casefold() for name in sheet.layout.header]
    words = [Words() for _ in header]
    for piece in sheet.pieces():
        for column, cells in zip(words, piece.columns, strict=True):
            column.add(cells)
    table = [[list(w.known)[code].strip() for code in w.codes().tolist()] for w in words]
    columns = dict(zip(header, table, strict=True))
    named = {signal: columns[signal] for signal in SIGNAL_WORDS if signal in columns}
    loop = columns.get("loop", columns.get("name"))
    if loop is not None and "pv" in named and "op" in named:
        rows = [
            (name, signal, tag)
            for signal, tags in named.items()
            for name, tag in zip(loop, tags, strict=True)
        ]
    elif loop is not None and "tag" in columns and "signal" in columns:
        triples = zip(loop, columns["signal"], columns["tag"], strict=True)
        rows = [(name, _known(signal, path), tag) for name, signal, tag in triples]
    else:
        raise InputError(
            f"has the columns {', '.join(sheet.layout.given)}",
            where=str(path),
            fix="a tag list has the columns loop,pv,sp,op,mode with a row a loop, or "
            "tag,loop,signal",
        )
    units = columns.get("op_unit", columns.get("unit", [""] * len(loop)))
    return TagList(
        _by_tag(rows, path),
        {name: op_unit(unit, path) for name, unit in zip(loop, units, strict=True) if unit},
    )


def _by_tag(rows: Sequence[tuple[str, str, str]], path: Path) -> dict[str, Tag]:
    found: dict[str, Tag] = {}
    for loop, signal, tag in rows:
        key = " ".join(tag.split()).casefold()
        if not key or not loop:
            continue
        if key in found and found[key] != Tag(loop, signal):
            raise InputError(f"tag {tag} is there twice", where=str(path), fix="list it once")
        found[key] = Tag(loop, signal)
    return found


def _known(word: str, path: Path) -> str:
    signal = SIGNALS.get(word.casefold())
    if signal is None:
        raise InputError(
            f"signal {word!r} is unknown", where=str(path), fix=f"use {', '.join(SIGNAL_WORDS)}"
        )
    return signal
