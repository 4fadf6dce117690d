"""What goes with every answer, whichever method gave it: what would decide, and plausibility."""

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.answer.step_answer import StepAnswer
from stiction_ros.identification.identification_options import IdentificationOptions
from stiction_ros.identification.judgement import contributions, definitions
from stiction_ros.identification.result import FitStatus, Identification, ValveEstimate, VerdictKind
from stiction_ros.records.record import Record
from stiction_ros.texts import spoken

# steps into which the largest band that is not rejected is divided, the first whose answers PV's
# noise does not hide: the band is then known to a quarter, which tells a valve to service from one
# to leave, or to a half, or it shows as a first step back that PV does not answer
STEPS = (4, 2, 1)
# samples of a hold that are averaged at most: beyond that loads move PV, so it is repeated
AVERAGED = 60
HELD = 3.0  # lags for which a step is held: by then PV shows 95 % of it
INTEGRATED = 20  # samples for which a step is held where PV does not settle
CLEAR = 4.0  # standard deviations of PV's noise that the answer to a step must make
CENTRED = 1e-3  # share of OP's range below which its mean is what a computer leaves of 0


@dataclasses.dataclass(frozen=True)
class Expected:
    """How a PV of one kind answers its valve."""

    fastest: float  # fastest, slowest: s until 63 % of the answer, dead time included
    slowest: float
    settles: bool | None  # whether it settles; None where both occur
    why: str  # half a sentence


# limits that hold for nearly all loops of a kind: qualities after the guidelines of Seborg, Edgar,
# Mellichamp, Process Dynamics and Control, chapter 12 (flow and liquid pressure fast and settling;
# level and gas pressure integrating; temperature and composition slow); the figures are decades
# beyond what is usual, so that only what cannot be is contradicted
EXPECTED: Mapping[str, Expected] = {
    "flow": Expected(
        0.0, 60.0, True, "a flow follows its valve and a damped transmitter within a minute"
    ),
    "pressure": Expected(
        0.0, 3600.0, None, "a liquid's pressure follows within seconds, a gas is stored"
    ),
    "level": Expected(10.0, float("inf"), None, "a vessel takes its time to fill"),
    "temperature": Expected(
        5.0, 7200.0, None, "a thermowell alone takes 5 s and more, a furnace up to two hours"
    ),
    "analyser": Expected(
        10.0, 14400.0, None, "a sample line and a mixed vessel take from 10 s to hours"
    ),
}


def advised(
    record: Record, found: Identification, options: IdentificationOptions
) -> Identification:
    """Return the identification with an experiment for each undecided valve, and notes.

    Args:
        record: what was measured.
        found: what a method made of it.
        options: of the method; ``kind`` is what is known of the loop beforehand.
    """
    valves = tuple(
        dataclasses.replace(valve, experiment=experiment_for(record, found, j))
        if valve.verdict is VerdictKind.UNDECIDED
        else valve
        for j, valve in enumerate(found.valves)
    )
    told = () if options.kind is None else _by_kind(record, found, options.kind)
    return dataclasses.replace(found, valves=valves, notes=(*found.notes, *told))


def _by_kind(record: Record, found: Identification, kind: str) -> tuple[str, ...]:
    """Return a sentence for each output on the valve that moves it most.

    It decides nothing about the valve: a process that a loop of this kind cannot have says that
    something else than the valve was fitted.
    """
    if found.status is not FitStatus.OK:
        return ()
    told = []
    for model in found.outputs:
        answers = [
            StepAnswer.of(model, valve, len(record), record.sample_time)
            for valve, taps in model.b.items()
            if any(taps)
        ]
        if answers:
            strongest = max(answers, key=lambda answer: answer.clearness)
            told.append(sentence_by_kind(kind, strongest))
    return tuple(told)


def sentence_by_kind(kind: str, answer: StepAnswer) -> str:
    """Return whether a loop of this kind answers its valve like this, in a sentence."""
    expected = EXPECTED[kind]
    if answer.lag is None:
        said = f"{answer.output} does not settle within the record"
        against = bool(expected.settles)
    else:
        seconds = answer.dead_time + answer.lag
        said = f"{answer.output} answers its valve within {seconds:.3g} s"
        against = not expected.fastest <= seconds <= expected.slowest
        if seconds < expected.fastest <= 2.0 * answer.sample_time:
            return f"{said}, which samples of {answer.sample_time:g} s do not tell from more"
    if not against:
        return f"{said}, as a {kind} may"
    return (
        f"{said}, which no {kind} does ({expected.why}): the model may have fitted a load or a "
        f"filter, and the friction with it"
    )


def experiment_for(record: Record, found: Identification, valve: int) -> str:
    """Return why a valve is undecided and what would decide, in sentences."""
    estimate = found.valves[valve]
    said = (
        _reason(estimate, float(np.ptp(record.op[:, valve]))),
        _travel_test(record, found, valve),
    )
    return " ".join(filter(None, said))


def _reason(estimate: ValveEstimate, span: float) -> str:
    """Return why nothing was decided: the figure that speaks most against what is likelier."""
    if not estimate.responds:
        return (
            f"PV does not answer OP of {estimate.name}: the stem is stuck, the valve is bypassed, "
            "a tag is the wrong one, or OP moves too little beside the loads on PV."
        )
    size = f"f_S {estimate.static_friction:.2g} %"
    high = estimate.static_interval[1]
    open_up_to = (
        f"The record does not rule out f_S up to {high:.2g} %, {100.0 * high / span:.0f} % of "
        "OP's range."
    )
    if estimate.figures is None or estimate.probability is None:
        if estimate.static_friction > 0.0:
            return f"The record speaks for {size}, but not clearly."
        return open_up_to
    if not estimate.is_likely:
        return open_up_to
    odds = contributions(estimate.figures)
    against = definitions()[min(odds, key=lambda name: odds[name])]["against"]
    percent = f"{100.0 * estimate.probability:.0f} %"
    return f"Friction, here {size}, is likely ({percent}) but not sure: {against}."


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


def _middle(op: FloatArray) -> float:
    """Return the mean of OP, shape (N,); of one that was centred what is left of it is none."""
    mean = float(op.mean())
    return mean if abs(mean) >= CENTRED * float(np.ptp(op)) else 0.0
