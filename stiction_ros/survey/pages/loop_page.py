"""The page of one loop: verdict, what helps, the signals, the notes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stiction_ros import __version__
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import Identification
from stiction_ros.identification.answer.words import materiality, next_step, why
from stiction_ros.records.record import Record
from stiction_ros.survey.entry import Entry
from stiction_ros.survey.pages.frame import card, framed, marked_card, text
from stiction_ros.survey.pages.plot import SCRIPT, Curve, against, over_time
from stiction_ros.survey.pages.trend import PLACE
from stiction_ros.survey.pages.unit import unit_mark
from stiction_ros.survey.pages.words import (
    PERCENT,
    cause_words,
    figure,
    in_op_unit,
    interval,
    percent,
    period,
)

HEADLINES = {
    "sticky": "The valve sticks",
    "backlash": "The valve has backlash",
    "healthy": "The valve is healthy",
    "undecided": "The record does not decide",
}

OPTIONS = {
    "service": "service the valve",
    "embedding": "controller that knows the friction",
    "retune": "retune",
    "leave": "leave it",
}

LIST = "../survey.html"


def loop_page(
    entry: Entry,
    record: Record,
    found: Identification,
    gain: Mapping[str, Any] | None,
    unit: str = "",
) -> str:
    """Return the page.

    Args:
        entry: row of the loop.
        record: part that was looked at.
        found: what identification made of it.
        gain: mapping of ``gain --json``, None where it was not simulated.
        unit: of PV; empty where none was given.
    """
    headline = HEADLINES.get(entry.verdict or "", "Not judged")
    op_unit = "% of travel" if entry.op_unit == PERCENT else "OP's own unit"
    cycle = entry.oscillation
    cards = [
        card(f"friction f_S, {op_unit}", figure(entry.f_s) or "–"),
        card("between", interval(entry.f_s_interval) or "–"),
        card(f"sliding friction f_D, {op_unit}", figure(entry.f_d) or "–"),
        card("of what OP moves is lost in the band", percent(entry.band_share) or "–"),
        card("confidence", percent(entry.confidence) or "–"),
        card("why it cycles", cause_words(entry.cause or "none")),
    ]
    if cycle is not None and cycle.period is not None:
        cards.append(card("period of the cycle", period(cycle.period)))
        cards.append(marked_card("its amplitude", f"{figure(cycle.amplitude)} {unit_mark(unit)}"))
    sentence = next((o.cause.sentence for o in found.outputs if o.cause is not None), "")
    reason = found.reason
    parts = [
        f'<p><a href="{LIST}">All loops</a></p>',
        f"<h1>{text(entry.name)}: {text(headline)}</h1>",
        f'<p class="soft">{text(_span(record))}</p>',
        f'<p class="note warn">The fit is not to be trusted: {text(reason)}</p>' if reason else "",
        f"<p>{text(sentence)}</p>" if sentence else "",
        *[f"<p>{text(said)}</p>" for said in _answers(found, entry.op_unit)],
        f'<div class="cards">{"".join(cards)}</div>',
        PLACE,
        gain_table(gain, unit, op_unit),
        *_figures(record, found, unit, op_unit),
        _notes(entry),
    ]
    return framed(f"{entry.name}: {headline}", parts, f"stiction_ros {__version__}", SCRIPT)


def _answers(found: Identification, op_unit: str) -> list[str]:
    """Return what ``identify`` says of each valve: why, how much it matters, what to do next."""
    told = []
    for j, valve in enumerate(found.valves):
        said = (why(found, j), materiality(valve), f"Next: {next_step(found, j, asked=True)}")
        told.append(in_op_unit(" ".join(filter(None, said)), op_unit))
    return told


def gain_table(gain: Mapping[str, Any] | None, unit: str, op_unit: str) -> str:
    """Return what would help as a table; nothing where it was not simulated."""
    if gain is None:
        return ""
    head = ("", "amplitude", "period, s", "mean |PV−SP|", "travel/h", "moves/h", "reversals/h", "")
    keys = (
        "amplitude",
        "period",
        "iae_per_hour",
        "travel_per_hour",
        "moves_per_hour",
        "reversals_per_hour",
    )
    rows = [_gain_row("now", gain["now"], head, keys, "")]
    for option in gain["options"]:
        ends = option["interval"].get("iae_per_hour")
        between = f" Mean |PV−SP| {interval((ends[0], ends[1]))}." if ends else ""
        name = OPTIONS[option["what"]]
        rows.append(_gain_row(name, option, head, keys, option["note"] + between))
    titles = "".join(f"<th>{text(title)}</th>" for title in head)
    return (
        f"<h2>What would help</h2><p class='soft'>Amplitude and mean |PV−SP| in "
        f"{unit_mark(unit)}, travel in {text(op_unit)}.</p><table class='list'><thead><tr>"
        f"{titles}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )


def _gain_row(
    name: str, measures: Mapping[str, Any], head: Sequence[str], keys: Sequence[str], note: str
) -> str:
    cells = "".join(
        f"<td data-label='{text(label)}'>{figure(measures[key]) or '–'}</td>"
        for label, key in zip(head[1:], keys, strict=False)
    )
    return (
        f"<tr><td class='t name'>{text(name)}</td>{cells}<td class='t wordy'>{text(note)}</td></tr>"
    )


def _span(record: Record) -> str:
    seconds = len(record) * record.sample_time
    return (
        f"{len(record)} samples of {record.sample_time:g} s, {period(seconds)} of operation, were "
        "looked at."
    )


def _figures(record: Record, found: Identification, unit: str, op_unit: str) -> list[str]:
    time, word = _hours(record)
    drawn = []
    for i, name in enumerate(record.outputs):
        curves = [Curve(f"{name}, measured", "pv", record.pv[:, i])]
        if record.sp is not None:
            curves.append(Curve("set-point", "sp", record.sp[:, i]))
        axis = f"{text(name)} ({unit_mark(unit)})"
        drawn.append(over_time(f"{name} and its set-point.", time, word, curves, axis))
    known = found.stem.shape == record.op.shape
    for j, name in enumerate(record.valves):
        curves = [Curve(f"{name}, controller output", "op", record.op[:, j])]
        if known:
            curves.append(Curve("stem, estimated", "stem", found.stem[:, j], steps=True))
        drawn.append(over_time(f"{name} and its stem.", time, word, curves, text(op_unit)))
        if known:
            title = (
                f"Stem of {name} against OP: a valve that sticks rests on level lines and then "
                "jumps, a healthy one stays on the diagonal."
            )
            drawn.append(against(title, record.op[:, j], found.stem[:, j], op_unit))
    return ["<h2>Signals</h2>", *drawn]


def _hours(record: Record) -> tuple[FloatArray, str]:
    span = len(record) * record.sample_time
    for word, size in (("hours", 3600.0), ("minutes", 60.0)):
        if span > 4.0 * size:
            return np.asarray(record.time / size), word
    return record.time, "seconds"


def _notes(entry: Entry) -> str:
    files = ", ".join(entry.files)
    notes = "".join(f"<li>{text(note)}</li>" for note in entry.notes)
    listed = f"<ul>{notes}</ul>" if notes else ""
    return f"<h2>Notes</h2><p class='soft'>Read from {text(files)}.</p>{listed}"
