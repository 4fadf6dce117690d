"""Tables with one value a row: told by names of columns, or by what stands in them."""

import re
import shlex
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import IntakeOptions
from stiction_ros.intake.sheets import names as tag_names
from stiction_ros.intake.sheets.cells import Cells, Numbers, Words
from stiction_ros.intake.sheets.sheet import Sheet
from stiction_ros.intake.tables.clock import TimeColumn, is_clock, kind_of, repeats, time_column
from stiction_ros.intake.tables.qualities import quality_places
from stiction_ros.intake.tables.tags import TagList


class OneValue(NamedTuple):
    """Columns of a table with one value a row; ``unit`` where there is one."""

    tag: int
    time: TimeColumn
    value: int
    unit: int | None


def one_value(
    sheet: Sheet, options: IntakeOptions, tags: TagList | None, top: Sequence[Cells]
) -> OneValue | None:
    """Return the columns of a table with one value a row; None for another table.

    It is told by the names of its columns or, where none of them is OP or PV, by what stands
    there: texts that name signals, stamps, numbers; refused where several may hold the values.
    """
    named = options.columns.time
    unit = _first(sheet, tag_names.UNIT_NAMES)
    if options.long is not None:
        tag, time, value = (sheet.column(name, "--long TAG,TIME,VALUE") for name in options.long)
        return OneValue(tag, TimeColumn(time), value, unit)
    usual = _first(sheet, tag_names.TAG_NAMES), _first(sheet, tag_names.VALUE_NAMES)
    if usual[0] is not None and usual[1] is not None and usual[0] != usual[1]:
        return OneValue(usual[0], time_column(sheet, named), usual[1], unit)
    header, read = sheet.layout.header, tag_names.read_tag if tags is None else tags.read
    if any(told.loop or told.signal in ("op", "pv") for told in map(read, header) if told):
        return None
    kinds = list(map(kind_of, top))
    beside = {unit, *quality_places(header, top)}
    texts = [k for k, kind in enumerate(kinds) if kind == "text" and repeats(top[k])]
    texts = [k for k in texts if k not in beside]
    stamps = [k for k, cells in enumerate(top) if is_clock(header[k], cells)]
    stamps = [k for k in stamps if len(top[k]) < 2 or len(set(top[k])) > 1]
    of_tags = [k for k in texts if any(t.loop for t in map(read, set(top[k])) if t)]
    if not stamps or (not of_tags and (len(texts) != 1 or read(sheet.name))):
        return None
    listed = any(header[k].casefold() in tag_names.TIME_NAMES for k in stamps)
    clock = time_column(sheet, named) if named or listed else TimeColumn(stamps[0])
    place = (of_tags or texts)[0]
    other = beside | {clock.place}
    values = [k for k, kind in enumerate(kinds) if kind == "number" and k not in other]
    values = [k for k in values if not _is_count(top[k], top[place])] or values
    values = [k for k in values if _is_value(header[k])] or values
    if len(values) == 1:
        return OneValue(place, clock, values[0], unit)
    if not of_tags or not values:
        return None
    given = sheet.layout.given
    raise InputError(
        f"holds one value a row, in one of the columns {', '.join(given[k] for k in values)}",
        fix=f"say which with --long TAG,TIME,VALUE, such as --long "
        f"{shlex.quote(','.join(given[k] for k in (place, clock.place, values[0])))}",
    )


def _is_count(cells: Cells, names: Cells) -> bool:
    """Return whether numbers stand still, or never fall within a tag, as times do."""
    read, words = Numbers(decimal_comma=True), Words()
    read.add(cells)
    words.add(names)
    order = np.argsort(words.codes(), kind="stable")
    same = np.diff(words.codes()[order]) == 0
    return not np.any(np.diff(read.values()[order])[same] < 0.0)


def _is_value(name: str) -> bool:
    """Return whether a part of a name says value: ``VarValue``, ``IP_TREND_VALUE``."""
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[^\W\d_A-Z]+", name)
    return any(part.casefold() in tag_names.VALUE_NAMES for part in parts)


def _first(sheet: Sheet, names: tuple[str, ...]) -> int | None:
    header = [name.casefold() for name in sheet.layout.header]
    return next((header.index(name) for name in names if name in header), None)
