"""Cells of a column as numbers or as words, a piece at a time."""

import dataclasses
import math
import re
import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.intake.words import pattern_of

Cells = Sequence[str] | NDArray[np.float64] | NDArray[np.datetime64]
"""One column of a piece of a table: text, numbers or stamps."""

BAD_WORDS = pattern_of("bad_words")  # what historians write in the place of a number
SHOWN = 30  # characters of a cell that an error shows

_SIGNS = str.maketrans({"\u2212": "-", "\u00a0": "", "\u202f": "", "\u2009": "", "'": ""})
"""Signs in numbers that are typeset: a minus, and spaces and marks between thousands."""

_UNIT = re.compile(
    r"([+-]?[\d.,]*\d(?:[eE][+-]?\d+)?)\s*"
    r"(?:%|°\s?[CF]?|[^\W\d_]+\d?/[^\W\d_]+\d?|"
    r"(?<=\s)(?:deg ?[CF]|[CFKVA]|m?bar[ag]?|[kM]?Pa|psi[ag]?|[mck]?m|kg|t|l|m3|m³|mA|Hz|rpm|ppm|"
    r"pH|in|ft))"
)
"""A number and its unit in one cell."""

_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")


def number(cell: str) -> float | None:
    """Return the number in a cell with a decimal point; None for text and for ``1_000``."""
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, with a point or a comma."""
    cell = cell.strip()
    return number(cell) is not None or _COMMA.fullmatch(cell) is not None


def as_text(cells: Cells) -> Sequence[str]:
    """Return cells as text; numbers with nine digits, none as an empty cell."""
    if isinstance(cells, np.ndarray):
        return ["" if cell != cell else f"{cell:.9g}" for cell in cells.tolist()]
    return cells


@dataclasses.dataclass
class Numbers:
    """A column of numbers as it grows."""

    decimal_comma: bool  # whether a lone comma in a number is decimal, and sets no thousands apart
    words: dict[int, str] = dataclasses.field(
        default_factory=dict
    )  # row to what is no number there
    _count: int = 0
    _pieces: list[FloatArray] = dataclasses.field(default_factory=list)
    _blank: list[NDArray[np.bool_]] = dataclasses.field(default_factory=list)

    def add(self, cells: Cells) -> None:
        """Add the next piece of the column."""
        values = _all_numbers(cells)
        if values is None:
            read = [self._number(str(cell).strip()) for cell in cells]
            values = np.array([math.nan if value is None else value for value in read])
        blank = np.zeros(len(cells), dtype=np.bool_)
        of_numbers = isinstance(cells, np.ndarray) and cells.dtype.kind != "M"
        for row in np.flatnonzero(~np.isfinite(values)).tolist():
            text = "" if of_numbers else str(cells[row]).strip()
            blank[row], values[row] = not text, math.nan
            if text:
                self.words[self._count + row] = sys.intern(text[:SHOWN])
        self._count += len(cells)
        self._pieces.append(values)
        self._blank.append(blank)

    def values(self) -> FloatArray:
        """Return the whole column, shape (N,), NaN where there is no finite number."""
        return np.concatenate([np.zeros(0), *self._pieces])

    def blank(self) -> NDArray[np.bool_]:
        """Return which cells are empty, shape (N,)."""
        return np.concatenate([np.zeros(0, dtype=np.bool_), *self._blank])

    def _number(self, text: str) -> float | None:
        """Return the number in a cell, also in one that is written for people."""
        value = number(text)
        if value is not None:
            return value
        plain = text.translate(_SIGNS)
        unit = _UNIT.fullmatch(plain)
        plain = unit[1] if unit else plain
        return number(self._with_point(plain) if "," in plain else plain)

    def _with_point(self, text: str) -> str:
        comma, point = text.rfind(","), text.rfind(".")
        if point > comma:
            return text.replace(",", "")
        if point >= 0:
            return text.replace(".", "").replace(",", ".")
        if self.decimal_comma and text.count(",") == 1:
            return text.replace(",", ".")
        grouped = re.fullmatch(r"[+-]?\d{1,3}(,\d{3})+", text)
        return text.replace(",", "") if grouped and not self.decimal_comma else text


def _all_numbers(cells: Cells) -> FloatArray | None:
    """Return cells as numbers, fast; None where one is text, or a number written for people."""
    if isinstance(cells, np.ndarray):
        return None if cells.dtype.kind == "M" else np.array(cells, dtype=np.float64)
    text = "".join(cells)
    if "_" in text or "," in text:
        return None
    try:
        return np.array(cells, dtype=object).astype(np.float64)
    except ValueError:
        return None


@dataclasses.dataclass
class Words:
    """A column of few different words as it grows; each ``known`` one has a code."""

    known: dict[str, int] = dataclasses.field(default_factory=dict)
    _pieces: list[NDArray[np.int32]] = dataclasses.field(default_factory=list)

    def add(self, cells: Cells) -> None:
        """Add the next piece of the column."""
        known = self.known
        codes = [known.setdefault(cell, len(known)) for cell in as_text(cells)]
        self._pieces.append(np.array(codes, dtype=np.int32))

    def codes(self) -> NDArray[np.int32]:
        """Return the code of each cell, shape (N,)."""
        return np.concatenate([np.zeros(0, dtype=np.int32), *self._pieces])

    def where(self, wanted: set[str]) -> NDArray[np.bool_]:
        """Return which cells hold one of some words, shape (N,)."""
        listed = [code for word, code in self.known.items() if word in wanted]
        return np.asarray(np.isin(self.codes(), listed))
