"""The loop closed again: does the identified friction keep this loop cycling as recorded?

The recovered controller, the identified process and friction are simulated together without
noise, from states that the record went through and from kicks. A valve that sticks keeps OP
moving as it was recorded, and without its friction OP comes to rest. Where a load from outside
moved the loop, friction fitted to it does neither.
"""

from __future__ import annotations

import dataclasses
import enum

from stiction_ros.identification.closed_loop.damping import LinearController, Ringing, ringing
from stiction_ros.identification.closed_loop.movement import STILL, Movement, compare
from stiction_ros.identification.closed_loop.oscillation import (
    Oscillation,
    oscillation,
)
from stiction_ros.identification.closed_loop.recovered_controller import (
    ControllerStatus,
    LoopSignals,
    RecoveredController,
    recover,
)
from stiction_ros.identification.closed_loop.repeated_runs import Repeated, period_of, span_of
from stiction_ros.identification.closed_loop.scaled_loop import ScaledLoop, scaled, scaled_process
from stiction_ros.identification.results import FitStatus, Identification
from stiction_ros.loop.set_points import holds
from stiction_ros.records.record import Record

UNSEEN_CYCLES = 10
"""Cycles that a record without an oscillation is taken to have room for."""

SPAN_SHARE = 3.0
"""Spans of the controller's fit go up to the period over this."""

MOST_ALIKE = 0.5
"""Share of the runs that must move as recorded."""

GROWN = 1.7
"""Movement over the recorded one that is another cycle."""


class LoopStatus(enum.StrEnum):
    """What a loop does when it is closed again.

    ``SUSTAINED``: OP moves as recorded with the friction. ``DIES``: it comes to rest, or
    moves otherwise. ``UNSTABLE``: it moves much more. ``UNTESTABLE``: it cannot be closed.
    """

    SUSTAINED = "sustained"
    DIES = "dies"
    UNSTABLE = "unstable"
    UNTESTABLE = "untestable"


@dataclasses.dataclass(frozen=True)
class ValveLoop:
    """One valve in its loop.

    Attributes:
        valve: its tag.
        output: tag of the output that its controller reads; empty when none was found.
        status: see :class:`LoopStatus`.
        reason: one sentence; empty when the loop could be closed.
        controller: as recovered, in the units of the record; None where no output fits.
        oscillation: of OP, %; None where there is none to speak of.
        with_friction, without_friction: movement of OP over the recorded one.
        ringing: of the loop without friction, the least damped first.
        driven: share of OP's movement, 0 to 1, that the loop without friction makes of the
            recorded set-point alone.
        band_share: f_S + f_D over the width of OP's movement about its slow mean.
        gone: share of the cycle of OP that goes away without the friction when what the model
            leaves is kept as a load.
    """

    valve: str
    output: str
    status: LoopStatus
    reason: str
    controller: RecoveredController | None
    oscillation: Oscillation | None
    with_friction: Movement
    without_friction: Movement
    ringing: tuple[Ringing, ...]
    driven: float
    band_share: float
    gone: float


@dataclasses.dataclass(frozen=True)
class ClosedLoop:
    """All valves of a record in their loops, and how its outputs oscillate.

    Attributes:
        valves: in the order of the record.
        oscillations: of PV − SP of each output; None where there is none to speak of.
        loads: of what the model leaves of each PV, the same.
        periods: of OP or PV of each output, samples.
    """

    valves: tuple[ValveLoop, ...]
    oscillations: tuple[Oscillation | None, ...]
    loads: tuple[Oscillation | None, ...]


def close_loop(record: Record, found: Identification) -> ClosedLoop:
    """Close every loop of a record again.

    Control is taken as decentralised: one valve per controller and output, paired by how much
    of OP the output explains.

    Args:
        record: what was measured.
        found: what identification made of it.
    """
    loop = scaled(record, found.stem) if found.status is FitStatus.OK else None
    if loop is None:
        reason = found.reason or "OP or PV does not move"
        valves = tuple(_untestable(tag, reason) for tag in record.valves)
        nothing = (None,) * len(record.outputs)
        return ClosedLoop(valves, nothing, nothing)
    process = scaled_process(found.outputs, record.valves, loop)
    swings = [oscillation(loop.op[:, j], loop.stretches) for j in range(loop.op.shape[1])]
    errors = [output_oscillation(loop, i) for i in range(loop.pv.shape[1])]
    periods = [period_of(swing, loop, UNSEEN_CYCLES) for swing in swings]
    pairs = paired(loop, periods)
    repeated = Repeated.of(loop, process, found.valves, pairs, periods)
    valves = tuple(_valve(record, found, repeated, j, swings[j]) for j in range(len(record.valves)))
    loads = [oscillation(repeated.load[:, i], loop.stretches) for i in range(loop.pv.shape[1])]
    return ClosedLoop(
        valves,
        tuple(in_units(one, loop.pv_scale[i]) for i, one in enumerate(errors)),
        tuple(in_units(one, loop.pv_scale[i]) for i, one in enumerate(loads)),
    )


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
    return oscillation(error, still if longest >= MOST_ALIKE * whole else loop.stretches)


def paired(loop: ScaledLoop, periods: list[float]) -> list[tuple[int, RecoveredController]]:
    """Return for each valve the output of its controller, −1 for none, and the controller."""
    valves, outputs = loop.op.shape[1], loop.pv.shape[1]
    table = {}
    for j in range(valves):
        for i in range(outputs):
            signals = LoopSignals(
                loop.op[:, j],
                loop.pv[:, i],
                None if loop.sp is None else loop.sp[:, i],
                loop.stretches,
            )
            table[j, i] = recover(signals, round(periods[j] / SPAN_SHARE))
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
    record: Record, found: Identification, repeated: Repeated, j: int, swing: Oscillation | None
) -> ValveLoop:
    loop, (i, law) = repeated.loop, repeated.pairs[j]
    scale = float(loop.op_scale[j])
    told = in_units(swing, scale)
    estimate = found.valves[j]
    band = (estimate.static_friction + estimate.dynamic_friction) / scale
    share = band / max(span_of(loop, j, repeated.periods[j]), 1e-12)
    if i < 0:
        blank = _untestable(record.valves[j], law.reason)
        return dataclasses.replace(blank, oscillation=told, band_share=share)
    recorded = repeated.recorded(j)
    period = repeated.periods[j]
    free = compare(repeated.without_friction(j), recorded, period)
    rings = ringing(
        repeated.process, i, j, LinearController(law.coefficients, law.lag, law.smoothing)
    )
    driven, gone = repeated.driven(j), 0.0
    if estimate.static_friction > 0.0:
        stuck = compare(repeated.with_friction(j), recorded, period)
        gone = repeated.gone(j)
        status, reason = _status(stuck), ""
    else:
        stuck, status, reason = STILL, LoopStatus.UNTESTABLE, "no friction was identified"
    return ValveLoop(
        record.valves[j],
        record.outputs[i],
        status,
        reason,
        _in_units(law, scale, float(loop.pv_scale[i]), float(loop.pv_mean[i])),
        told,
        stuck,
        free,
        rings,
        driven,
        share,
        gone,
    )


def _status(stuck: Movement) -> LoopStatus:
    if stuck.alike >= MOST_ALIKE:
        return LoopStatus.SUSTAINED
    return LoopStatus.UNSTABLE if stuck.ratio > GROWN else LoopStatus.DIES


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


def _untestable(tag: str, reason: str) -> ValveLoop:
    return ValveLoop(
        tag, "", LoopStatus.UNTESTABLE, reason, None, None, STILL, STILL, (), 0.0, 0.0, 0.0
    )
