"""A window of four cycles, and PV against OP in it: where an engineer looks first."""

from __future__ import annotations

import dataclasses

from stiction_ros.identification import Identification
from stiction_ros.identification.answer.words import cause_of
from stiction_ros.records.record import Record
from stiction_ros.report.drawing import BLUE, GREY, PALE, Drawing, TimeAxis, legend, panels
from stiction_ros.report.shapes import draw_output, draw_valve

CYCLES = 4

UNCYCLED = 240
"""Samples of the window where there is no cycle."""

MARKED = 250
"""Samples up to which each is marked in the window."""


@dataclasses.dataclass(frozen=True)
class Window:
    """The part of a record that is shown closely.

    Attributes:
        valve, output: indices.
        first, last: its first row and the one behind its last.
        period: of the cycle, s; None where there is none.
    """

    valve: int
    output: int
    first: int
    last: int
    period: float | None

    @classmethod
    def of(cls, record: Record, found: Identification) -> Window:
        """Return four cycles from the middle of the longest good part.

        The valve is the one with the widest band, the output the one that oscillates with it.
        """
        valve = max(range(len(found.valves)), key=lambda j: found.valves[j].band_share, default=0)
        cause = cause_of(found, valve) if found.valves else None
        outputs = [i for i, model in enumerate(found.outputs) if model.cause is cause]
        output = outputs[0] if cause is not None and outputs else min(valve, record.pv.shape[1] - 1)
        period = None if cause is None else cause.period
        parts = record.usable_rows() or [(0, len(record))]
        begin, end = max(parts, key=lambda part: part[1] - part[0])
        wanted = UNCYCLED if period is None else round(CYCLES * period / record.sample_time) + 1
        wanted = min(wanted, end - begin)
        first = begin + (end - begin - wanted) // 2
        return cls(valve, output, first, first + wanted, period)

    @property
    def rows(self) -> slice:
        """Its rows."""
        return slice(self.first, self.last)

    def named(self, sample_time: float) -> str:
        """Return what is shown, in words."""
        if self.period is None:
            return f"{self.last - self.first} samples without a regular cycle"
        cycles = (self.last - self.first - 1) * sample_time / self.period
        whole = "four" if cycles > CYCLES - 0.5 else f"{cycles:.1f}"
        return f"{whole} cycles of {self.period:.3g} s"


def draw_window(record: Record, found: Identification, window: Window) -> Drawing:
    """Draw PV, SP, OP and the estimated stem over the window."""
    figure, axes = panels(2, 4.8, sharex=True)
    rows, j = window.rows, window.valve
    time = TimeAxis.spanning((window.last - window.first) * record.sample_time)
    at = time(record.time[rows] - record.time[window.first])
    draw_output(axes[0, 0], at, record, window.output, rows)
    axes[0, 0].set_ylabel(f"{record.outputs[window.output]} (PV units)")
    known = found.stem.shape == record.op.shape
    stem = found.stem[rows, j] if known else None
    true = None if record.stem is None else record.stem[rows, j]
    draw_valve(axes[1, 0], at, record.op[rows, j], true, stem)
    if len(at) <= MARKED:
        axes[0, 0].plot(at, record.pv[rows, window.output], ".", color=BLUE, markersize=3.5)
        axes[1, 0].plot(at, record.op[rows, j], ".", color=GREY, markersize=3.5)
    axes[1, 0].set_title(record.valves[j])
    axes[1, 0].set_xlabel(f"time in the window ({time.unit})")
    axes[1, 0].set_xlim(at[0], at[-1])
    for axis in axes[:, 0]:
        legend(axis)
    shown = window.named(record.sample_time)
    caption = (
        f"{shown[0].upper()}{shown[1:]} from the middle of the record. Where the stem rests while "
        "OP travels, PV is left alone; where it moves, PV follows."
    )
    return Drawing("cycles", "A close look", caption, figure)


def draw_plane(record: Record, window: Window) -> Drawing:
    """Draw PV against OP, the window over the whole record."""
    figure, axes = panels(1, 4.4)
    axis, rows = axes[0, 0], window.rows
    op, pv = record.op[:, window.valve], record.pv[:, window.output]
    axis.plot(op, pv, color=PALE, linewidth=0.7, label="whole record")
    axis.plot(op[rows], pv[rows], color=BLUE, linewidth=1.2, label="the close look")
    axis.set_xlabel(f"OP of {record.valves[window.valve]} (%)")
    axis.set_ylabel(f"{record.outputs[window.output]} (PV units)")
    legend(axis)
    caption = (
        "Friction makes corners: OP travels while PV hardly answers, then PV steps. Without it a "
        "cycle draws an ellipse, and a loop that does not cycle a cloud."
    )
    return Drawing("pv_op", "PV against OP", caption, figure)
