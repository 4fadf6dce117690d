"""The signals of a record as figures: a close look, PV and stem against OP, and all of it."""

from __future__ import annotations

import dataclasses

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import Identification
from stiction_ros.pages.frame import text
from stiction_ros.pages.plot import MOST, Curve, against, over_time
from stiction_ros.pages.window import Window
from stiction_ros.records.record import Record


@dataclasses.dataclass(frozen=True)
class Units:
    """Units of PV and of OP, HTML."""

    pv: str
    op: str


def close_look(record: Record, found: Identification, units: Units) -> str:
    """Return four cycles of one valve over time, and PV and the stem against OP.

    Args:
        record: that was looked at.
        found: identification of this record.
        units: of its signals.
    """
    window = Window.of(record, found)
    rows, i, j = window.rows, window.output, window.valve
    shown = window.named(record.sample_time)
    time = record.time[rows]
    start = record.start
    stem = found.stem if found.stem.shape == record.op.shape else None
    looks = [
        over_time(
            f"{shown[0].upper()}{shown[1:]} from the middle of the record.",
            time,
            _output(record, i, rows),
            _axis(record.outputs[i], units.pv),
            start,
        ),
        over_time(
            "While the stem rests and OP travels, PV does not answer; PV follows where the stem "
            "moves.",
            time,
            _valve(record, stem, j, rows),
            units.op,
            start,
        ),
    ]
    return f"<h2>A close look</h2>{''.join(looks)}{_planes(record, stem, window, units)}"


def all_signals(record: Record, stem: FloatArray | None, units: Units) -> str:
    """Return each signal of a record over its time.

    Args:
        record: its samples that are not finite leave a gap.
        stem: estimated stems, shape (N, m), % of travel; None where there is none.
        units: of its signals.
    """
    rows = slice(None)
    drawn = [
        over_time(
            f"{name}{' and its set-point' * (record.sp is not None)}.",
            record.time,
            _output(record, i, rows),
            _axis(name, units.pv),
            record.start,
        )
        for i, name in enumerate(record.outputs)
    ]
    drawn += [
        over_time(
            f"Controller output to {name}{' and the stem' * (stem is not None)}.",
            record.time,
            _valve(record, stem, j, rows),
            units.op,
            record.start,
        )
        for j, name in enumerate(record.valves)
    ]
    return f"<h2>Signals</h2>{''.join(drawn)}"


def _axis(name: str, unit: str) -> str:
    return f"{text(name)} ({unit})"


def _output(record: Record, i: int, rows: slice) -> list[Curve]:
    curves = [Curve(f"{record.outputs[i]}, measured", "pv", record.pv[rows, i])]
    if record.sp is not None:
        curves.append(Curve("set-point", "sp", record.sp[rows, i], steps=True))
    return curves


def _valve(record: Record, stem: FloatArray | None, j: int, rows: slice) -> list[Curve]:
    curves = [Curve(f"OP of {record.valves[j]}", "op", record.op[rows, j], steps=True)]
    if record.stem is not None:
        curves.append(Curve("stem, measured", "ink", record.stem[rows, j], steps=True))
    if stem is not None:
        curves.append(Curve("stem, estimated", "stem", stem[rows, j], steps=True))
    return curves


def _planes(record: Record, stem: FloatArray | None, window: Window, units: Units) -> str:
    """Return PV and the stem of each valve against OP, side by side."""
    middle = (window.first + window.last) // 2
    first = max(min(middle - MOST // 2, len(record) - MOST), 0)
    around, rows = slice(first, first + MOST), window.rows
    name = "whole record" if len(record) <= MOST else f"{MOST} samples around it"
    op, pv = record.op[:, window.valve], record.pv[:, window.output]
    drawn = [
        against(
            "PV against OP. Friction makes corners: OP travels while PV hardly answers, then PV "
            "steps. Without friction a cycle draws an ellipse.",
            [
                (op[around], Curve(name, "whole", pv[around])),
                (op[rows], Curve("the close look", "pv", pv[rows])),
            ],
            (
                f"OP of {text(record.valves[window.valve])}, {units.op}",
                _axis(record.outputs[window.output], units.pv),
            ),
            equal=False,
        )
    ]
    for j, valve in enumerate(record.valves):
        if stem is None:
            break
        drawn.append(
            against(
                f"Stem of {valve} against OP. A valve that sticks rests on level lines and then "
                "jumps; a healthy valve stays on the diagonal.",
                [(record.op[around, j], Curve("stem, estimated", "stem", stem[around, j]))],
                (f"OP of {text(valve)}, {units.op}", f"stem, {units.op}"),
                equal=True,
            )
        )
    return f"<div class='pair'>{''.join(drawn)}</div>"
