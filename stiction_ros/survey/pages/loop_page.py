"""The page of one loop: that of its record, with what would help."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from stiction_ros.gain.advice import MEASURES, NAMES, advice
from stiction_ros.identification import Identification
from stiction_ros.pages.frame import text
from stiction_ros.pages.signals import UNITS, Units
from stiction_ros.records.record import Record
from stiction_ros.report.page import Cell, table
from stiction_ros.report.record_page import record_page
from stiction_ros.survey.entry import Entry
from stiction_ros.survey.pages import words as say


def loop_page(
    entry: Entry,
    record: Record,
    found: Identification,
    gain: Mapping[str, Any] | None,
    unit: str = "",
) -> str:
    """Return the page of a loop; ``gain`` is that of ``gain --json``, ``unit`` that of PV."""
    op_unit = UNITS.op if entry.op_unit == say.PERCENT else text("OP's own unit")
    units = Units(text(unit) or UNITS.pv, op_unit)
    above = '<p><a href="../survey.html">All loops</a></p>'
    notes = [*entry.notes, f"Read from {', '.join(entry.files)}."]
    helps = "" if gain is None else gain_table(gain, units)
    named = dataclasses.replace(record, name=entry.name)
    return record_page(named, found, units=units, above=above, helps=helps, notes=notes)


def gain_table(gain: Mapping[str, Any], units: Units) -> str:
    """Return what would help as a table."""
    told: list[tuple[str, Mapping[str, Any], str]] = [("now", gain["now"], "")]
    for option in gain["options"]:
        ends = option["interval"].get("iae_per_hour")
        between = f" Mean |PV−SP| {say.interval((ends[0], ends[1]))}." if ends else ""
        what = NAMES.get(option["what"], "leave it")
        told.append((what, option, option["note"] + between))
    rows: list[list[Cell]] = [
        [what, *(say.figure(found[key]) or "–" for key in MEASURES), ("t wordy", note)]
        for what, found, note in told
    ]
    return (
        f"<h2>What would help</h2><p>{text(advice(gain))}</p><p class='soft'>Amplitude and mean "
        f"|PV−SP| in {units.pv}, travel in {units.op}.</p>"
        + table(("what is done", *MEASURES.values(), "how it was found"), rows)
    )
