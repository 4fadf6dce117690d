"""Names of tags and columns: which loop they belong to, and which of its signals they are."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from stiction_ros.errors import InputError
from stiction_ros.intake.options import OpUnit, op_unit
from stiction_ros.intake.sheets.cells import Words
from stiction_ros.intake.sheets.typed import open_sheets

SIGNAL_WORDS: Mapping[str, tuple[str, ...]] = {
    "pv": ("pv", "meas", "process_value", "processvalue", "pv_in", "me"),
    "sp": ("sp", "sv", "spt", "setpoint", "set_point", "set point", "wsp"),
    "op": ("op", "out", "mv", "co", "output", "opout", "lmn", "cout"),
    "stem": ("stem", "zt", "pos", "position", "travel"),
    "mode": ("mode", "md", "mode_act", "modeact", "a/m", "am", "auto"),
}
"""Last part of a tag, in the words of the makers of control systems, by signal."""

TIME_NAMES = (
    *("t", "time", "timestamp", "time stamp", "datetime", "date time", "date/time", "stamp", "ts"),
    *("_time", "utc", "local time", "zeit", "zeitstempel", "date", "datum", "record time"),
)
TAG_NAMES = (
    *("tag", "tagname", "tag name", "point", "pointname", "point name", "name", "sensor", "item"),
    *("itemid", "item id", "variable", "signal", "id", "point id", "pointid"),
)
VALUE_NAMES = ("value", "val", "_value", "reading", "wert", "numeric value", "messwert")
QUALITY_NAMES = ("quality", "status", "qual", "opc quality", "quality code", "opcquality", "q")
UNIT_NAMES = ("unit", "units", "uom", "eu", "engunits", "eng units", "einheit")

_SIGNAL = {word: signal for signal, words in SIGNAL_WORDS.items() for word in words}
_ATTRIBUTE = re.compile(r"(?i)[./](cv|f_cv|val|value|act|actual|target|measured)$")
_BLOCK = re.compile(r"(?i)[./](pid\w*|regctl\w*|daca\w*|pic|fic_block|pidx|ctrl)$")
_QUALITY = re.compile(r"(?i)[ ._:/-](quality|status|qual|q)$")
_WORDS = "|".join(sorted(map(re.escape, _SIGNAL), key=len, reverse=True))
_TAG = re.compile(rf"(?i)(.+?)\s*(?:[._:/\\ -]|::)\s*({_WORDS})")


class Tag(NamedTuple):
    """What a name says.

    Attributes:
        loop: name of the loop; empty for a bare ``PV``.
        signal: ``pv``, ``sp``, ``op``, ``stem`` or ``mode``.
        quality: whether it is the quality of that signal.
    """

    loop: str
    signal: str
    quality: bool = False


def read_tag(name: str) -> Tag | None:
    """Return what a tag or a column's name says; None when it says nothing.

    ``FIC101.PV``, ``FIC101/PID1/OUT.CV``, ``FIC101_SP``, ``FIC101.PIDA.MODE``, ``PV``.
    """
    bare = " ".join(name.split())
    quality = _QUALITY.search(bare)
    if quality:
        bare = bare[: quality.start()]
    attribute = _ATTRIBUTE.search(bare)
    if attribute:
        bare = bare[: attribute.start()]
    signal = _SIGNAL.get(bare.casefold())
    if signal is not None:
        return Tag("", signal, quality is not None)
    found = _TAG.fullmatch(bare)
    if found is None:
        return None
    loop = _BLOCK.sub("", found[1])
    return Tag(loop, _SIGNAL[found[2].casefold()], quality is not None)


def is_name(name: str) -> bool:
    """Return whether a cell looks like the name of a column."""
    folded = " ".join(name.split()).casefold()
    known = (*TIME_NAMES, *TAG_NAMES, *VALUE_NAMES, *QUALITY_NAMES, *UNIT_NAMES)
    return folded in known or read_tag(name) is not None


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
    signal = _SIGNAL.get(word.casefold())
    if signal is None:
        raise InputError(
            f"signal {word!r} is unknown", where=str(path), fix=f"use {', '.join(SIGNAL_WORDS)}"
        )
    return signal
