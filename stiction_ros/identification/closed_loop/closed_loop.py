"""The loop closed again: how much of its movement goes away without the identified friction?

The recovered controller, the identified process and friction are simulated together with noise of
the spectrum of the record's. A valve that sticks keeps OP moving as it was recorded, and without
its friction OP moves less. Where a load from outside moved the loop, friction fitted to it does
neither.
"""

import dataclasses
import math

import numpy as np

from stiction_ros.identification.closed_loop.repeated_runs import MOST, Repeated, span_of
from stiction_ros.identification.closed_loop.scaled_loop import ScaledLoop, scaled, scaled_process
from stiction_ros.identification.result import FitStatus, Identification, ValveEstimate
from stiction_ros.loop.linear_loops import Process, Ringing, ringing
from stiction_ros.records.record import Record
from stiction_ros.signals.controller_recovery import ControllerStatus, RecoveredController, recover
from stiction_ros.signals.holds import holds
from stiction_ros.signals.oscillation import Oscillation, amplitude, oscillation
from stiction_ros.signals.outside_line import NO_LINE, OutsideLine, Predicted, beside, outside_line

UNSEEN_CYCLES = 10  # cycles that a record without an oscillation is taken to have room for
SPAN_SHARE = 3.0  # spans of the controller's fit go up to the period over this
LONG_HOLD = 0.5  # share of the longest stretch that the longest hold of the set-point must have


@dataclasses.dataclass(frozen=True)
class ValveLoop:
    """One valve in its loop."""

    valve: str  # its tag
    output: str  # tag of the output that its controller reads; empty when none was found
    reason: str  # why the loop could not be closed, one sentence; empty when it could
    # as recovered, in the units of the record; None where no output fits
    controller: RecoveredController | None = None
    oscillation: Oscillation | None = None  # of OP, %; None where there is none to speak of
    ringing: tuple[Ringing, ...] = ()  # of the loop without friction, the least damped first
    # the same for the process beside a wave at the period of the cycle, see ``outside_line.beside``
    ringing_beside: tuple[Ringing, ...] = ()
    # share of OP's movement, 0 to 1, that the loop without friction makes of the recorded set-point
    # alone
    driven: float = 0.0
    band_share: float = 0.0  # f_S + f_D over the width of OP's movement about its slow mean
    moved_with: float = 0.0  # movement of OP when the record is repeated, see ``Moved``
    # share of the movement of OP, or of PV − SP, that goes away with the friction
    gone: float = 0.0
    before: OutsideLine = NO_LINE  # a line from outside in OP, beside what comes from PV
    outside: OutsideLine = NO_LINE  # a line from outside in PV, beside what comes from the stem


@dataclasses.dataclass(frozen=True)
class OutputLoop:
    """One output in its loop."""

    name: str  # its tag
    # of PV − SP, engineering units; None where there is no room for one
    oscillation: Oscillation | None
    # a line from outside in PV at this period, beside what comes from the stems
    after: OutsideLine = NO_LINE
    alone: OutsideLine = NO_LINE  # the same beside what comes from valves that follow OP
    # how the recorded set-point oscillates; None where it does not, or there is none
    set_point: Oscillation | None = None
    # line of the recorded set-point at this period over that of PV; None where no set-point was
    # recorded
    set_point_line: float | None = None

    @property
    def rivalry(self) -> float:
        """BIC gain by the line alone over the gain by friction; infinite where that is none.

        Where there is no line there is no rival either: it is 0 or below.
        """
        friction = self.alone.plain - self.after.plain
        if friction > 0.0:
            return self.alone.gain / friction
        return math.inf if self.alone.gain > 0.0 else 0.0


@dataclasses.dataclass(frozen=True)
class ClosedLoop:
    """All valves and outputs of a record in their loops, in the order of the record."""

    valves: tuple[ValveLoop, ...]
    outputs: tuple[OutputLoop, ...]


def close_loop(record: Record, found: Identification) -> ClosedLoop:
    """Close every loop of a record again.

    Control is taken as decentralised: one valve per controller and output, paired by how much
    of OP the output explains.
    """
    loop = scaled(record, found.stem) if found.status is FitStatus.OK else None
    if loop is None:
        reason = found.reason or "OP or PV does not move"
        return ClosedLoop(
            tuple(ValveLoop(tag, "", reason) for tag in record.valves),
            tuple(OutputLoop(tag, None) for tag in record.outputs),
        )
    process = scaled_process(found.outputs, record.valves, loop)
    swings, periods = op_cycles(loop)
    outputs = [_output(loop, process, tag, i) for i, tag in enumerate(record.outputs)]
    repeated = Repeated.of(loop, process, found.valves, paired(loop, periods), periods)
    valves = [
        _valve(repeated, estimate, outputs, in_units(swing, loop.op_scale[j]), j)
        for j, (estimate, swing) in enumerate(zip(found.valves, swings, strict=True))
    ]
    in_pv = [
        dataclasses.replace(one, oscillation=in_units(one.oscillation, loop.pv_scale[i]))
        for i, one in enumerate(outputs)
    ]
    return ClosedLoop(tuple(valves), tuple(in_pv))


def _output(loop: ScaledLoop, process: Process, tag: str, i: int) -> OutputLoop:
    """Return how an output oscillates, scaled, and whether a clock outside drives it."""
    swing = output_oscillation(loop, i)
    if swing is None:
        return OutputLoop(tag, None)
    rows = _last_rows(loop)
    delays = [int(delay) + 1 for delay in process.delay[i]]
    after, alone = (
        outside_line(Predicted(loop.pv[rows, i], list(inputs[rows].T), delays), swing.period)
        for inputs in (loop.stem, loop.op)
    )
    if loop.sp is None:
        return OutputLoop(tag, swing, after, alone)
    whole = [(0, rows.stop - rows.start)]
    lines = [
        amplitude(values[rows, i], whole, swing.period) or 0.0 for values in (loop.sp, loop.pv)
    ]
    driver = oscillation(loop.sp[:, i], loop.stretches)
    return OutputLoop(tag, swing, after, alone, driver, lines[0] / max(lines[1], 1e-300))


def _last_rows(loop: ScaledLoop) -> slice:
    """Return the end of the longest stretch, as many samples as a run has at most."""
    first, last = loop.longest
    return slice(max(first, last - MOST), last)


def output_oscillation(loop: ScaledLoop, i: int) -> Oscillation | None:
    """Return how PV − SP of an output oscillates between moves of its set-point.

    Where the set-point moves most of the time, it is looked at throughout.
    """
    if loop.sp is None:
        return oscillation(loop.pv[:, i], loop.stretches)
    error = loop.pv[:, i] - loop.sp[:, i]
    still = [(a + f, a + b) for a, z in loop.stretches for f, b in holds(loop.sp[a:z, i : i + 1])]
    longest = max(b - a for a, b in still)
    whole = max(b - a for a, b in loop.stretches)
    return oscillation(error, still if longest >= LONG_HOLD * whole else loop.stretches)


def op_cycles(loop: ScaledLoop) -> tuple[list[Oscillation | None], list[float]]:
    """Return how each OP oscillates, and its period, or that of cycles that could not be seen."""
    first, last = loop.longest
    swings = [oscillation(op, loop.stretches) for op in loop.op.T]
    unseen = (last - first) / UNSEEN_CYCLES
    return swings, [unseen if swing is None else swing.period for swing in swings]


def paired(loop: ScaledLoop, periods: list[float]) -> list[tuple[int, RecoveredController]]:
    """Return for each valve the output of its controller, −1 for none, and the controller."""
    valves, outputs = loop.op.shape[1], loop.pv.shape[1]
    table = {}
    for j in range(valves):
        for i in range(outputs):
            sp, span = None if loop.sp is None else loop.sp[:, i], round(periods[j] / SPAN_SHARE)
            table[j, i] = recover(loop.op[:, j], loop.pv[:, i], sp, loop.stretches, span)
    chosen: dict[int, int] = {}
    for j, i in sorted(table, key=lambda key: -table[key].r_squared):
        if j not in chosen and i not in chosen.values():
            chosen[j] = i
    pairs = []
    for j in range(valves):
        i = chosen.get(j, -1)
        law = table[j, max(i, 0)]
        pairs.append((i if law.status is ControllerStatus.OK else -1, law))
    return pairs


def in_units(swing: Oscillation | None, scale: float) -> Oscillation | None:
    """Return an oscillation of a scaled signal in its own units."""
    if swing is None:
        return None
    return dataclasses.replace(swing, amplitude=swing.amplitude * float(scale))


def _valve(
    repeated: Repeated,
    estimate: ValveEstimate,
    outputs: list[OutputLoop],
    swing: Oscillation | None,
    j: int,
) -> ValveLoop:
    loop, (i, law), period = repeated.loop, repeated.pairs[j], repeated.periods[j]
    scale, tag = float(loop.op_scale[j]), estimate.name
    band = (estimate.static_friction + estimate.dynamic_friction) / scale
    share = band / max(span_of(loop, j, period), 1e-12)
    if i < 0:
        return ValveLoop(tag, "", law.reason, oscillation=swing, band_share=share)
    linear = law.coefficients, law.lag, law.smoothing
    cycle = outputs[i].oscillation
    at = outputs[i].alone.period or (period if cycle is None else cycle.period)
    rows = _last_rows(loop)
    error = law.set_point[rows] - loop.pv[rows, i]
    moved = repeated.moved(j, at)
    return ValveLoop(
        tag,
        outputs[i].name,
        "",
        _in_units(law, scale, float(loop.pv_scale[i]), float(loop.pv_mean[i])),
        swing,
        ringing(repeated.process, i, j, *linear),
        ringing(_beside(loop, repeated.process, i, at), 0, j, *linear),
        repeated.driven(j),
        share,
        moved.with_friction,
        moved.gone,
        outside_line(Predicted(loop.op[rows, j], [error], [0]), at),
        outputs[i].after,
    )


def _beside(loop: ScaledLoop, process: Process, i: int, period: float) -> Process:
    """Return the process of one output from valves that follow OP, beside a wave."""
    rows = _last_rows(loop)
    delays = process.delay[i]
    a, b = beside(
        Predicted(loop.pv[rows, i], list(loop.op[rows].T), [int(d) + 1 for d in delays]), period
    )
    return Process(a[None], b[None], delays[None], np.zeros(1))


def _in_units(
    law: RecoveredController, op_scale: float, pv_scale: float, pv_mean: float
) -> RecoveredController:
    """Return a controller between scaled signals in the units of the record."""
    ratio = op_scale / pv_scale
    return dataclasses.replace(
        law,
        coefficients=law.coefficients * ratio,
        covariance=law.covariance * ratio**2,
        set_point=law.set_point * pv_scale + pv_mean,
    )
