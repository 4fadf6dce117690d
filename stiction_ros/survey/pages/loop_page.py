"""The page of one loop: verdict, what helps, the signals, the notes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stiction_ros import __version__
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import Identification
from stiction_ros.records.record import Record
from stiction_ros.survey.entry import Entry
from stiction_ros.survey.pages.frame import card, framed, text
from stiction_ros.survey.pages.plot import SCRIPT, Curve, against, over_time, spark
from stiction_ros.survey.pages.words import CAUSES, figure, interval, percent, period

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
TREND = "<!-- trend --><!-- /trend -->"
"""Where it stands how the loop did in earlier surveys, which no worker knows."""


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
    pv_unit = f" {unit}" if unit else ""
    op_unit = "% of travel" if entry.op_unit == "%" else entry.op_unit
    cycle = entry.oscillation
    cards = [
        card(f"friction f_S, {op_unit}", figure(entry.f_s) or "–"),
        card("between", interval(entry.f_s_interval) or "–"),
        card(f"sliding friction f_D, {op_unit}", figure(entry.f_d) or "–"),
        card("of what OP moves is lost in the band", percent(entry.band_share) or "–"),
        card("confidence", percent(entry.confidence) or "–"),
        card("why it cycles", CAUSES.get(entry.cause or "none") or "no cycle"),
    ]
    if cycle is not None and cycle.period is not None:
        cards.append(card("period of the cycle", period(cycle.period)))
        cards.append(card("its amplitude", f"{figure(cycle.amplitude)}{pv_unit}"))
    sentence = next((o.cause.sentence for o in found.outputs if o.cause is not None), "")
    reason = found.reason
    parts = [
        f'<p><a href="{LIST}">All loops</a></p>',
        f"<h1>{text(entry.name)}: {text(headline)}</h1>",
        f'<p class="soft">{text(_span(record))}</p>',
        f'<p class="note warn">The fit is not to be trusted: {text(reason)}</p>' if reason else "",
        f"<p>{text(sentence)}</p>" if sentence else "",
        *[f"<p>{text(valve.experiment)}</p>" for valve in found.valves if valve.experiment],
        f'<div class="cards">{"".join(cards)}</div>',
        TREND,
        gain_table(gain, unit),
        *_figures(record, found, unit, op_unit),
        _notes(entry),
    ]
    return framed(f"{entry.name}: {headline}", parts, f"stiction_ros {__version__}", SCRIPT)


def with_trend(page: str, bands: Sequence[float]) -> str:
    """Return a page with the band of earlier surveys and of this one, the oldest first, in it.

    Args:
        page: HTML of a loop, with a trend or without.
        bands: f_S + f_D, in the unit of OP.
    """
    begin, end = TREND.split("><")
    begin, end = f"{begin}>", f"<{end}"
    before, found, rest = page.partition(begin)
    if not found:
        return page
    told = ", ".join(figure(band) for band in bands)
    shown = f"<h2>Earlier surveys</h2><p>Band f_S + f_D: {told} {spark(bands)}</p>"
    return f"{before}{begin}{shown}{end}{rest.partition(end)[2]}"


def gain_table(gain: Mapping[str, Any] | None, unit: str) -> str:
    """Return what would help as a table; nothing where it was not simulated."""
    if gain is None:
        return ""
    of_pv = f", {unit}" if unit else ""
    work = ("travel %/h", "moves/h", "reversals/h")
    head = ("", f"amplitude{of_pv}", f"IAE per hour{of_pv}", *work, "")
    keys = (
        "amplitude",
        "iae_per_hour",
        "travel_per_hour",
        "moves_per_hour",
        "reversals_per_hour",
    )
    rows = [_gain_row("now", gain["now"], head, keys, "")]
    for option in gain["options"]:
        ends = option["interval"].get("iae_per_hour")
        between = f" IAE {interval((ends[0], ends[1]))}." if ends else ""
        name = OPTIONS[option["what"]]
        rows.append(_gain_row(name, option, head, keys, option["note"] + between))
    titles = "".join(f"<th>{text(title)}</th>" for title in head)
    return (
        "<h2>What would help, simulated</h2><table class='list'><thead><tr>"
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
        axis = f"{name} ({unit or 'PV units'})"
        drawn.append(over_time(f"{name} and its set-point.", time, word, curves, axis))
    known = found.stem.shape == record.op.shape
    for j, name in enumerate(record.valves):
        curves = [Curve(f"{name}, controller output", "op", record.op[:, j])]
        if known:
            curves.append(Curve("stem, estimated", "stem", found.stem[:, j], steps=True))
        drawn.append(over_time(f"{name} and its stem.", time, word, curves, op_unit))
        if known:
            title = (
                f"Stem of {name} against OP: a valve that sticks rests on level lines and then "
                "jumps, a healthy one stays on the diagonal."
            )
            drawn.append(against(title, record.op[:, j], found.stem[:, j]))
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
