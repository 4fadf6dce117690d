"""Where a table begins: delimiter, titles, header, units."""

import dataclasses
import itertools
import re
from collections import Counter
from collections.abc import Sequence

from stiction_ros.intake.sheets.cells import BAD_WORDS, is_number
from stiction_ros.intake.sheets.names import VALUE_NAMES, is_name, read_tag
from stiction_ros.intake.sheets.stamps import is_stamp
from stiction_ros.intake.words import pattern_of

DELIMITERS = ("\t", ";", "|", ",")  # in the order tried: commas and bars may stand inside cells
SPACE = " "  # what stands for white space of any length
WHOLE = 0.6  # share of the usual number of cells that a row of data has at least
LOOKED_AT = 40  # lines at the top of a file that are looked at

UNITS = pattern_of("units_row")
_BRACKETS = re.compile(r"\s*[\[(]([^\[\]()]*)[\])]\s*$")


@dataclasses.dataclass(frozen=True)
class Layout:
    """Where things are in a table."""

    header: tuple[str, ...]  # names of the columns without units in brackets; empty for none
    given: tuple[str, ...]  # names as they stand there
    units: tuple[str, ...]  # unit of each column, empty where not known
    first: int = 0  # row of cells (not counting blank ones) at which data begin
    place: int = 0  # row of cells of the header


def delimiter_of(lines: Sequence[str]) -> str:
    """Return what separates the cells: what stands in most lines the same number of times."""
    bare = [re.sub('"[^"]*"', "", line) for line in lines if line.strip()]
    if bare and (named := re.fullmatch(r"\s*sep=(.)\s*", bare[0])):
        return named[1]
    spaces = [line.split() for line in bare]
    numbers = [row for row in spaces if len(row) > 1 and all(map(is_number, row))]
    if len(numbers) > 0.5 * len(bare) and not any(mark in "".join(bare) for mark in "\t;|"):
        return SPACE
    for delimiter in DELIMITERS:
        counts = [line.count(delimiter) for line in bare]
        if sum(count > 0 for count in counts) > 0.5 * len(counts):
            return delimiter
    if sum(len(row) > 1 for row in spaces) > 0.5 * len(bare):
        return SPACE
    return max(DELIMITERS, key=lambda d: bare[0].count(d) if bare else 0)


def spaced(line: str) -> list[str]:
    """Return what white space separates in a line; in one without any, commas or semicolons."""
    cells = line.split()
    return cells if len(cells) != 1 else re.split("[,;]", cells[0])


def layout_of(rows: Sequence[Sequence[str]]) -> Layout:
    """Return where header, units and data are by the first rows that are not blank."""
    first = _first_data(rows)
    above = list(rows[:first])
    told = bool(above and re.fullmatch(r"sep=.?", above[0][0].strip()))
    above = above[told:]
    if not above:
        return Layout((), (), (), first)
    width = len(rows[first]) if first < len(rows) else max(map(len, above))
    place = _header_place(above, width)
    given = [" ".join(cell.split()) for cell in above[place]]
    alike = [k for k, name in enumerate(given) if place and name.casefold() in VALUE_NAMES]
    for k in alike if len(alike) > 1 else ():  # their tags stand above them
        near = next((cell for cell in above[place - 1][k::-1] if cell.strip()), "")
        given[k] = " ".join(near.split()) if read_tag(near) else given[k]
    layout = named_columns(given)
    below = next(filter(_is_units, above[place + 1 :]), [])
    pairs = itertools.zip_longest(layout.units, below[: len(given)], fillvalue="")
    units = tuple(unit or cell.strip() for unit, cell in pairs)
    return dataclasses.replace(layout, units=units, first=first, place=told + place)


def named_columns(given: Sequence[str]) -> Layout:
    """Return the layout of columns by their names alone, units in brackets cut off."""
    header, units = [], []
    for name in given:
        found, bare = _BRACKETS.search(name), _BRACKETS.sub("", name)
        header.append(bare or name)
        units.append(found[1].strip() if found and bare else "")
    return Layout(tuple(header), tuple(given), tuple(units))


def _first_data(rows: Sequence[Sequence[str]]) -> int:
    """Return the first row that looks like data; else the second one."""
    width = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
    for place, row in enumerate(rows):
        if len(row) < WHOLE * width:
            continue
        cells = [cell.strip() for cell in row if cell.strip()]
        told = sum(is_number(c) or is_stamp(c) for c in cells)
        silent = sum(bool(BAD_WORDS.fullmatch(c)) for c in cells)
        if told and told + silent >= 0.5 * len(cells) and not _is_units(row) and len(row) > 1:
            return place
    return min(1, len(rows))


def _header_place(above: Sequence[Sequence[str]], width: int) -> int:
    """Return which row holds the names: the one with most of them known, else the fullest."""
    ranks = []
    for place, row in enumerate(above):
        known = sum(is_name(_BRACKETS.sub("", cell)) for cell in row)
        ranks.append((known, min(sum(bool(cell.strip()) for cell in row), width), -place))
    return -max(ranks)[2]


def _is_units(row: Sequence[str]) -> bool:
    told = [cell for cell in (cell.strip().strip("[]()") for cell in row) if cell]
    return all(map(UNITS.fullmatch, told)) and not all(map(is_number, told))
