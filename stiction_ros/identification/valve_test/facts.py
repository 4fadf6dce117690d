"""What a record of a loop, or of a test, tells for the next round of the test."""

import dataclasses
import math

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.answer.step_answer import StepAnswer
from stiction_ros.identification.evidence.sensor_hold import held_rows
from stiction_ros.identification.result import Identification
from stiction_ros.identification.valve_test.frictions import SMALLEST
from stiction_ros.identification.valve_test.judgement import Judgement, judged, measured_enough
from stiction_ros.identification.valve_test.plan import CLEAR, WIDENS, Facts
from stiction_ros.identification.valve_test.steps import SHORTEST, Steps
from stiction_ros.records.record import Quality, Record

LAGS = 1.8
"""Lags of a hold: PV then shows five sixths of its answer, the model tells the rest."""


def facts_before(record: Record, found: Identification) -> Facts:
    """Return what a routine record of a loop tells.

    OP may go by twice the largest f_S that the record does not reject, PV as far as that moves it
    beside what it does by itself.

    Args:
        record: of one valve and one output.
        found: what identification made of it.

    Raises:
        InputError: several valves or outputs.
    """
    _of_one_loop(record)
    valve, step, model = found.valves[0], record.sample_time, found.outputs[0]
    answer = StepAnswer.of(model, valve.name, len(record), step)
    shown = record.pv[:, 0]
    left = shown - model.free_run({valve.name: found.stem[:, 0]}, shown)
    if not np.isfinite(left).all():  # a level: PV bounds what it does by itself
        left = shown
    facts = facts_of_answer(answer, valve.name, float(record.op[-1, 0]), 0.0, left)
    pv = float(shown[-round(facts.hold / step) :].mean())
    reach = max(2.0 * valve.static_interval[1], WIDENS**2 * SMALLEST)
    room = float(np.abs(shown - pv).max()) + reach * abs(facts.gain or 0.0)
    return dataclasses.replace(facts, pv=pv).within(reach, room)


def facts_of_answer(
    answer: StepAnswer, valve: str, op: float, pv: float, left: FloatArray | None = None
) -> Facts:
    """Return what the answer to a step tells, without limits.

    A move is held for the dead time and :data:`LAGS` lags; where PV does not settle until the
    smallest pair of moves shows, but for no longer than half of the answer that is known.

    Args:
        answer: of PV to 1 % of stem.
        valve: tag.
        op, pv: where the test begins, % and engineering units.
        left: what the answer leaves of PV in a record, shape (N,); None: white noise.
    """
    step, known = answer.sample_time, len(answer.values)
    least, longest = SHORTEST + 1, max(known // 2, SHORTEST + 1)
    if answer.lag is not None:
        samples = (answer.dead_time + LAGS * answer.lag) / step
    else:
        slope = abs(float(answer.values[-1])) / known
        samples = 0.5 * CLEAR * answer.noise / max(SMALLEST * slope, 1e-300)
        samples = min(answer.dead_time / step + max(samples, least), longest)
    count = max(math.ceil(samples - 1e-9), least)
    gain: float | None = None
    if np.isfinite(answer.values).all() and np.abs(answer.values).max() > 0.0:
        gain = float(answer.values[min(count, known - 1)]) or None
    noise = answer.noise / math.sqrt(count) if left is None else noise_over(left, count)
    everywhere = (-math.inf, math.inf)
    return Facts(valve, op, pv, gain, noise, answer.dead_time, count * step, math.inf, everywhere)


def noise_over(left: FloatArray, count: int) -> float:
    """Return the standard deviation of the mean over ``count`` samples, by those side by side.

    Args:
        left: what a model leaves of PV, shape (N,).
        count: samples; half of N where that is less.

    Returns:
        0 for fewer than two samples.
    """
    count = min(count, len(left) // 2)
    if not count:
        return 0.0
    sums = np.cumsum(np.append(0.0, left))
    means = (sums[count:] - sums[:-count]) / count
    return float(np.sqrt(0.5 * np.mean((means[count:] - means[:-count]) ** 2)))


def facts_of_test(record: Record, judgement: Judgement) -> Facts:
    """Return what a test tells where nothing was known before it.

    OP and PV may go by :data:`WIDENS` squared times as far as they went.
    """
    trial = judgement.trial
    levels, pv = trial.steps.levels, float(trial.pv[: int(trial.steps.rows[0])].mean())
    room = WIDENS**2 * float(np.abs(trial.pv - pv).max())
    return Facts(
        valve=record.valves[0],
        op=float(levels[0]),
        pv=pv,
        gain=None,
        noise=0.0,
        dead=0.0,
        hold=trial.hold * record.sample_time,
        op_limit=WIDENS**2 * trial.steps.reach,
        pv_limit=(pv - room, pv + room),
    )


def judged_record(record: Record, gain: float | None = None) -> Judgement:
    """Return the verdict on a record of a test: of what is marked as manual, if anything is.

    Args:
        record: of one valve and one output.
        gain: what 1 % of the stem makes of PV within a hold, where that was known before.

    Raises:
        InputError: several valves or outputs, or OP does not move as by hand.
    """
    _of_one_loop(record)
    wanted = (Quality.GOOD, Quality.HELD)
    if (record.quality == Quality.MANUAL).any():
        wanted = (Quality.MANUAL, Quality.HELD)
    rows = max(record.usable_rows(wanted), key=lambda each: each[1] - each[0], default=(0, 0))
    part = record.part(*rows)
    steps = Steps.of(part.op[:, 0])
    error = -part.pv[:, 0] if part.sp is None else part.sp[:, 0] - part.pv[:, 0]
    if why := steps.refusal(error):
        raise InputError(
            f"is no test in manual: {why}",
            where=record.name,
            fix="record OP moved by hand, or judge the loop by stiction identify",
        )
    if not measured_enough(part.pv[:, 0], len(steps.rows)):
        measured = int((~held_rows(part.pv[:, 0])).sum())
        raise InputError(
            f"PV shows {measured} values that are measured, too few for its moves of OP",
            where=record.name,
            fix="record PV at a shorter sample time, or hold each move for longer",
        )
    return judged(part.op[:, 0], part.pv[:, 0], gain)


def _of_one_loop(record: Record) -> None:
    if len(record.valves) != 1 or len(record.outputs) != 1:
        raise InputError(
            f"has {len(record.valves)} valves and {len(record.outputs)} outputs",
            where=record.name,
            fix="name the one valve and the one output of the test by --op and --pv",
        )
