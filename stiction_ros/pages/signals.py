"""The signals of a record as figures: a close look, PV and stem against OP, and all of it."""

import dataclasses
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification import Identification
from stiction_ros.identification.answer.summary import as_html, cause_of
from stiction_ros.identification.result import CauseKind
from stiction_ros.intake.intake import record_of
from stiction_ros.pages.frame import framed, text
from stiction_ros.pages.plot import MOST, SCRIPT, Curve, against, over_time
from stiction_ros.records.record import Record

CYCLES = 4
UNCYCLED = 240  # samples of the window where there is no cycle


@dataclasses.dataclass(frozen=True)
class Units:
    """Units of PV and of OP, HTML; ``outputs`` has those of single PVs by name."""

    pv: str = "PV units"
    op: str = "% of travel"
    outputs: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def axis(self, output: str) -> str:
        """Return name and unit of a PV."""
        return f"{text(output)} ({self.outputs.get(output, self.pv)})"

    def said(self, html: str) -> str:
        """Return in these units what is said of a loop in PV units and in %; shares of OP stay."""
        if not self.op.startswith("%"):
            html = re.sub(r"(\d) %( of travel|(?! of\b))", r"\1 units", html)
        return html.replace(UNITS.pv, self.pv)


UNITS: Units = Units()
ALL = slice(None)  # rows of a whole record


@dataclasses.dataclass(frozen=True)
class Figure:
    """Figures of a record in a page of HTML: a notebook shows it, :meth:`save` writes it."""

    page: str = dataclasses.field(repr=False)

    def _repr_html_(self) -> str:
        frame = 'title="figures of a record" style="width:100%;height:40em;border:0"'
        return f'<iframe srcdoc="{text(self.page)}" {frame}></iframe>'

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the figures as a page, such as ``look.html``, and return the file.

        Raises:
            OSError: nothing can be written there.
        """
        target = Path(path)
        target.write_text(self.page, encoding="utf-8")
        return target


def plot(
    record: Record | str | os.PathLike[str], identification: Identification | None = None
) -> Figure:
    """Return each signal of a record over time; with an identification a close look first.

    Args:
        record: what was measured, or the path of a file or bag of one loop.
        identification: of this record. Adds four cycles, PV and stem against OP, and the stem.

    Returns:
        Figures that a notebook shows; ``save(path)`` writes them as a page that can be zoomed.

    Raises:
        InputError: the file cannot be read, or the identification has another length.

    Examples:
        >>> from stiction_ros import LoopModel, find_config, plot, simulate
        >>> record = simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=200)
        >>> plot(record).save("look.html").name
        'look.html'
    """
    measured, found = record_of(record), identification
    if found is not None and found.samples != len(measured):
        said = f"it has {found.samples} samples, the record {len(measured)}"
        raise InputError(said, where="identification", fix="give that of this record")
    parts = [f"<h1>{text(measured.name)}</h1>"]
    stem = None
    if found is not None:
        stem = found.stem if found.stem.shape == measured.op.shape else None
        parts += [as_html(found), close_look(measured, found, UNITS)]
    return Figure(framed(measured.name, [*parts, all_signals(measured, stem, UNITS)], SCRIPT))


def close_look(record: Record, found: Identification, units: Units) -> str:
    """Return four cycles of one valve over time, and PV and the stem against OP."""
    window = Window.of(record, found)
    rows, i, j = window.rows, window.output, window.valve
    shown = window.named(record.sample_time)
    time = record.time[rows]
    start = record.start
    stem = found.stem if found.stem.shape == record.op.shape else None
    looks = [
        over_time(
            f"{shown[0].upper()}{shown[1:]}, from the middle of the record.",
            time,
            _output(record, i, rows),
            units.axis(record.outputs[i]),
            start,
        ),
        over_time(
            "OP and stem of the same time. Look for stretches in which OP travels and the stem "
            "rests: there PV does not answer.",
            time,
            _valve(record, stem, j, rows),
            units.op,
            start,
        ),
    ]
    return f"<h2>A close look</h2>{''.join(looks)}{_planes(record, stem, window, units)}"


def all_signals(record: Record, stem: FloatArray | None, units: Units) -> str:
    """Return each signal of a record over its time; a ``stem`` is an estimate, shape (N, m), %."""
    drawn = over_record(record, stem, units)
    return f"<h2>Signals</h2>{''.join(drawn)}"


def over_record(
    record: Record,
    stem: FloatArray | None,
    units: Units,
    rows: slice = ALL,
    *,
    marks: Sequence[float] = (),
    shade: Sequence[tuple[float, float]] = (),
) -> list[str]:
    """Return a figure of each PV and then of each OP over some ``rows``, as :func:`over_time`."""
    time = record.time[rows]
    known = stem is not None or record.stem is not None
    drawn = [
        (
            f"{name}{' and its set-point' * (record.sp is not None)}.",
            _output(record, i, rows),
            units.axis(name),
        )
        for i, name in enumerate(record.outputs)
    ]
    drawn += [
        (
            f"Controller output to {name}{' and the stem' * known}.",
            _valve(record, stem, j, rows),
            units.op,
        )
        for j, name in enumerate(record.valves)
    ]
    return [
        over_time(title, time, curves, axis, record.start, shade, marks=marks)
        for title, curves, axis in drawn
    ]


def _output(record: Record, i: int, rows: slice) -> list[Curve]:
    curves = [Curve(f"{record.outputs[i]}, measured", "pv", record.pv[rows, i])]
    if record.sp is not None:
        curves.append(Curve("set-point", "sp", record.sp[rows, i], steps=True))
    return curves


def _valve(record: Record, stem: FloatArray | None, j: int, rows: slice) -> list[Curve]:
    curves = [Curve(f"OP of {record.valves[j]}", "op", record.op[rows, j], steps=True)]
    if record.stem is not None:
        curves.append(Curve("stem, recorded", "ink", record.stem[rows, j], steps=True))
    if stem is not None:
        curves.append(Curve("stem, estimated", "stem", stem[rows, j], steps=True))
    return curves


def _planes(record: Record, stem: FloatArray | None, window: "Window", units: Units) -> str:
    """Return PV and the stem of each valve against OP, side by side."""
    middle = (window.first + window.last) // 2
    first = max(min(middle - MOST // 2, len(record) - MOST), 0)
    around, rows = slice(first, first + MOST), window.rows
    name = "whole record" if len(record) <= MOST else f"{MOST} samples around it"
    op, pv = record.op[:, window.valve], record.pv[:, window.output]
    drawn = [
        against(
            "PV against OP. Look for corners: with friction OP travels while PV hardly answers, "
            "then PV steps; without it a cycle draws an ellipse. Noise and loads hide both.",
            [
                (op[around], Curve(name, "whole", pv[around])),
                (op[rows], Curve("the close look", "pv", pv[rows])),
            ],
            (
                f"OP of {text(record.valves[window.valve])}, {units.op}",
                units.axis(record.outputs[window.output]),
            ),
            equal=False,
        )
    ]
    for j, valve in enumerate(record.valves):
        if stem is None:
            break
        drawn.append(
            against(
                f"Estimated stem of {valve} against OP. Level lines: the stem rests. Between them "
                "it moves or jumps. Without friction it stays on the diagonal.",
                [(record.op[around, j], Curve("stem, estimated", "stem", stem[around, j]))],
                (f"OP of {text(valve)}, {units.op}", f"stem, {units.op}"),
                equal=True,
            )
        )
    return f"<div class='pair'>{''.join(drawn)}</div>"


@dataclasses.dataclass(frozen=True)
class Window:
    """The part of a record that is shown closely."""

    valve: int  # valve, output: indices
    output: int
    first: int  # first, last: its first row and the one behind its last
    last: int
    period: float | None  # of the cycle, s; None where there is none

    @classmethod
    def of(cls, record: Record, found: Identification) -> "Window":
        """Return four cycles from the middle of the longest good part.

        The valve is the one with the widest band, the output the one that oscillates with it.
        """
        valve = max(range(len(found.valves)), key=lambda j: found.valves[j].band_share, default=0)
        cause = cause_of(found, valve) if found.valves else None
        outputs = [i for i, model in enumerate(found.outputs) if model.cause is cause]
        output = outputs[0] if cause is not None and outputs else min(valve, record.pv.shape[1] - 1)
        cycles = cause is not None and cause.kind is not CauseKind.NONE
        period = cause.period if cause is not None and cycles else None
        parts = record.usable_rows() or [(0, len(record))]
        begin, end = max(parts, key=lambda part: part[1] - part[0])
        wanted = UNCYCLED if period is None else round(CYCLES * period / record.sample_time) + 1
        wanted = min(wanted, end - begin)
        first = begin + (end - begin - wanted) // 2
        return cls(valve, output, first, first + wanted, period)

    @property
    def rows(self) -> slice:
        return slice(self.first, self.last)

    def named(self, sample_time: float) -> str:
        """Return what is shown, in words."""
        if self.period is None:
            return f"{self.last - self.first} samples without a regular cycle"
        cycles = (self.last - self.first - 1) * sample_time / self.period
        return f"about {cycles:.2g} cycles of {self.period:.3g} s on average"
