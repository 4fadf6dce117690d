"""What would decide on a valve where its record does not: an experiment with figures from it."""

from __future__ import annotations

import math

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.answer.step_answer import StepAnswer
from stiction_ros.identification.closed_loop.explanation import (
    MATERIAL,
    beside_wave,
    is_echoed,
    is_wave_itself,
)
from stiction_ros.identification.identification_options import IdentificationOptions
from stiction_ros.identification.inference.verdict import price_of_few
from stiction_ros.identification.result.identification import Identification, ValveEstimate
from stiction_ros.records.record import Record
from stiction_ros.texts import spoken

STEPS = (4, 2, 1)
"""Steps into which the largest band that is not rejected is divided, the first whose answers PV's
noise does not hide: the band is then known to a quarter, which tells a valve to service from one to
leave, or to a half, or it shows as a first step back that PV does not answer."""

AVERAGED = 60
"""Samples of a hold that are averaged at most: beyond that loads move PV, so it is repeated."""

HELD = 3.0
"""Lags for which a step is held: by then PV shows 95 % of it."""

INTEGRATED = 20
"""Samples for which a step is held where PV does not settle."""

CLEAR = 4.0
"""Standard deviations of PV's noise that the answer to a step must make."""

CENTRED = 1e-3
"""Share of OP's range below which its mean is what a computer leaves of 0."""

MOST = 10.0
"""Times the record beyond which more of the same is no advice."""


def experiment_for(
    record: Record, found: Identification, valve: int, options: IdentificationOptions
) -> str:
    """Return why a valve is undecided and what would decide, in sentences.

    Args:
        record: what was measured.
        found: what identification made of it.
        valve: index of one that is undecided.
        options: of the identification.
    """
    estimate = found.valves[valve]
    short = (options.bic_margin if found.method == "exact" else 0.0) - estimate.evidence.get(
        "delta_bic", 0.0
    )
    said = (
        _reason(estimate, short, options.min_moves, float(np.ptp(record.op[:, valve]))),
        _travel_test(record, found, valve),
        _more(estimate, short, len(record) * record.sample_time),
    )
    return " ".join(filter(None, said))


def _reason(estimate: ValveEstimate, short: float, least_moves: int, span: float) -> str:
    """Return why nothing was decided; ``short`` is what the evidence for friction lacks."""
    told = estimate.evidence
    if not estimate.responds:
        return (
            f"PV does not answer OP of {estimate.name}: the stem is stuck, the valve is bypassed, "
            "a tag is the wrong one, or OP moves too little beside the loads on PV."
        )
    if "delta_bic" not in told:
        return "This method does not weigh friction against none."
    size = f"f_S {estimate.static_friction:.2g} %"
    if short < 0.0:
        few = -short < price_of_few(told["moves"], least_moves)
        if few or told["moves"] < least_moves:
            return f"By {size} the stem moves {told['moves']:.0f} times only."
        band = estimate.static_friction + estimate.dynamic_friction
        if is_wave_itself(told, band / span):
            return (
                f"By {size} the stem goes to and fro once in each turn of a wave from outside and "
                "cannot be told from it: in manual the wave would go on while OP rests."
            )
        if is_echoed(told):
            return (
                f"The record speaks for {size}, but PV also repeats itself a turn later, which no "
                "valve does, as beside another loop that cycles: in manual that would go on while "
                "OP rests."
            )
        if not told.get("alike", 1.0):
            return (
                f"The record speaks for friction, here {size}, but no two rates that see all of "
                "the process's response agree on its size."
            )
        if min(told["half_1"], told["half_2"]) <= 0.0:
            return f"One half of the record only speaks for {size}."
        if told.get("loop_gone", 1.0) < MATERIAL:
            return f"The loop would move nearly as much without {size}."
        return f"The record speaks for {size}, which hardly matters."
    if estimate.static_friction > 0.0 and min(told["half_1"], told["half_2"]) > 0.0:
        beside = ", beside a wave from outside" if beside_wave(told) else ""
        return f"The record speaks for {size}{beside}, but not clearly."
    high = estimate.static_interval[1]
    share = 100.0 * high / span
    return f"The record does not reject f_S up to {high:.2g} %, {share:.0f} % of OP's range."


def _travel_test(record: Record, found: Identification, valve: int) -> str:
    """Return the test in manual, sized by the band and the process; nothing without a process."""
    name, samples = record.valves[valve], len(record)
    answers = [
        StepAnswer.of(model, name, samples, record.sample_time)
        for model in found.outputs
        if any(model.b.get(name, ()))
    ]
    answers = [one for one in answers if np.isfinite(one.values).all() and one.clearness > 0.0]
    if not answers:
        return ""
    answer = max(answers, key=lambda one: one.clearness)
    if answer.lag is None:
        hold = answer.dead_time + INTEGRATED * record.sample_time
        shows = f"{answer.output} changes its slope"
    else:
        hold = answer.dead_time + HELD * max(answer.lag, record.sample_time)
        shows = f"{answer.output} moves"
    estimate = found.valves[valve]
    op = record.op[:, valve]
    high = estimate.static_interval[1] + estimate.dynamic_interval[1]
    band = min(high, float(np.ptp(op)))
    alone = (CLEAR * answer.noise / max(band * answer.after(hold), 1e-300)) ** 2
    parts = next((each for each in STEPS if alone * each**2 <= AVERAGED), STEPS[-1])
    averaged = min(math.ceil(max(alone * parts**2, 1.0)), AVERAGED)
    hold += (averaged - 1) * record.sample_time
    times = math.ceil(alone * parts**2 / AVERAGED)
    again = f", {times} times over" if times > 1 else ""
    return (
        f"In manual, move OP of {name} by {band:.2g} % up from {_middle(op):.3g} %, back "
        f"down and up again{again}, in steps of {band / parts:.2g} % held for {spoken(hold)} "
        f"each: without friction {shows} at every step, with friction only after OP has gone back "
        "by the band."
    )


def _more(estimate: ValveEstimate, short: float, seconds: float) -> str:
    """Return how much more of the same record would do: evidence grows with its length."""
    told = estimate.evidence
    gained = told.get("half_1", 0.0) + told.get("half_2", 0.0)
    if short <= 0.0 or short > (MOST - 1.0) * gained:
        return ""
    factor = 1.0 + short / gained
    return (
        f"Or record {factor:.1f} times as long, {spoken(factor * seconds)}, with the loop as it is."
    )


def _middle(op: FloatArray) -> float:
    """Return the mean of OP, shape (N,); of one that was centred what is left of it is none."""
    mean = float(op.mean())
    return mean if abs(mean) >= CENTRED * float(np.ptp(op)) else 0.0
