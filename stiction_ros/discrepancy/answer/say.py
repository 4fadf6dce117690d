"""Step 6: one word for all looks, the experiment that would say more, and what stems say alone."""

from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.answer.found_effects import FoundEffect
from stiction_ros.discrepancy.answer.results import Look
from stiction_ros.discrepancy.candidate.base import figures_of
from stiction_ros.discrepancy.candidate.valve import ValveCandidate
from stiction_ros.discrepancy.decision.decide import GapVerdict
from stiction_ros.discrepancy.decision.explanation import AddedEffect
from stiction_ros.discrepancy.decision.scores import Testable
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.measures import LONGEST_DELAY, MAJORITY, NEGLIGIBLE
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import FloatArray, about

PLACES = {
    "valve": "valve {tag}",
    "load": "the load at {tag}",
    "process": "the process to {tag}",
    "disturbance": "a disturbance on {tag}",
    "sensor": "the sensor of {tag}",
}


def overall(
    shown: Sequence[FoundEffect],
    effects: Sequence[FoundEffect],
    looks: Sequence[Look],
    testable: Sequence[Testable],
    gained: float,
) -> tuple[GapVerdict, tuple[tuple[str, str], ...]]:
    """Return the verdict of all looks and what stays possible beside the effects.

    With several effects it is that of the largest, which is found first; each effect has a
    verdict of its own. What is left in doubt and leaves a larger noise than declared explains
    nothing. What the values of the record show by themselves is no answer to what else there is.

    Args:
        shown: by the values of the record.
        effects: all others.
        looks: the rounds.
        testable: what the last look could have seen.
        gained: evidence of all effects and changes of the process together.
    """
    last = looks[-1].decision
    left = max(fit.evidence for fit in looks[-1].scores.fits)
    unknown = last.verdict is GapVerdict.UNKNOWN and left > MAJORITY * gained
    if effects:
        alternatives = tuple(dict.fromkeys(n for each in effects for n in each.alternatives))
        return (GapVerdict.UNKNOWN if unknown else effects[0].verdict), alternatives
    if last.verdict is GapVerdict.AMBIGUOUS and not last.inseparable and last.chosen is not None:
        if any(noise.enlarged for noise in last.chosen.noise.values()):
            return GapVerdict.UNKNOWN, ()
        names = [*last.chosen.candidate.keys, *last.alternatives]
        return GapVerdict.AMBIGUOUS, tuple(dict.fromkeys(names))
    if unknown:
        return GapVerdict.UNKNOWN, ()
    if shown:
        return GapVerdict.NAMED, ()
    seen = any(t.testable for t in testable if t.place.startswith(("valve:", "process:")))
    refused = last.chosen is not None and not looks[-1].kept
    return (GapVerdict.NONE if seen or refused else GapVerdict.UNTESTABLE), ()


def experiment_for(
    verdict: GapVerdict,
    effects: Sequence[FoundEffect],
    alternatives: Sequence[tuple[str, str]],
    testable: Sequence[Testable],
) -> str:
    """Return what to do to learn more; empty when there is nothing to tell apart."""
    if verdict is GapVerdict.UNTESTABLE:
        return "; ".join(dict.fromkeys(t.experiment for t in testable if not t.testable))
    if verdict is GapVerdict.UNKNOWN:
        return "record the stem position and a second sensor, and move the set-point in steps"
    if not alternatives:
        return ""
    keys = {*alternatives, *((each.place, each.effect) for each in effects if each.alternatives)}
    told = [about(name).separation for name in sorted({effect for _, effect in keys})]
    if {"load", "disturbance"} <= {place.partition(":")[0] for place, _ in keys}:
        told.append("measure the flow behind the valve: a load shows there")
    return "; ".join(dict.fromkeys(filter(None, told))) or "take a longer record"


def reason_for(effect: AddedEffect, looks: Sequence[Look]) -> str:
    """Return one sentence: why an effect, and not its rivals."""
    key = effect.fit.candidate.key
    found = [each for each in looks if each.scores.of(*key) is not None]
    if not found:
        return ""
    own_looks = [
        each
        for each in found
        if each.decision.chosen is not None and each.decision.chosen.candidate.key == key
    ]
    look = (own_looks or found)[0]  # else it came in at the end, in the stead of others
    own = look.scores.of(*key)
    assert own is not None
    rivals = [
        fit
        for fit in sorted(look.scores.fits, key=lambda fit: -fit.evidence)
        if fit.candidate.key not in (key, *effect.alternatives)
    ]
    gained = f"It gains {own.evidence:.0f} BIC over no effect"
    if not rivals:
        return gained
    second = rivals[0]
    if second.evidence <= 0.0:
        return f"{gained}; no other effect gains anything"
    rival = called(second.candidate.place, second.candidate.effect, second.candidate.law)
    if second.evidence > own.evidence:  # it came in when others were known
        return f"{gained}; {rival} gained more before the other effects were in the model"
    return f"{gained}, the next best ({rival}) {second.evidence:.0f}"


def called(place: str, effect: str, law: str | None = None) -> str:
    """Return an effect for people, such as ``stiction (he) of valve V1``."""
    kind, _, tag = place.partition(":")
    effect = effect.replace("_", " ").replace("pole", "pole (order)") + (f" ({law})" if law else "")
    return f"{effect} of {PLACES[kind].format(tag=tag)}" if kind in PLACES else effect


def stem_sentences(run: FreeRun, fits: Sequence[CandidateFit]) -> list[str]:
    """Return what every stem says that is recorded throughout, effects as they fit PV."""
    found = []
    for j, name in enumerate(run.model.valve_names):
        stem = run.runs.stem(name)
        if not np.isnan(stem).any():
            found.append(f"the stem of {name} is recorded: {_stem_said(run, j, stem, fits)}")
    return found


def _stem_said(run: FreeRun, valve: int, stem: FloatArray, fits: Sequence[CandidateFit]) -> str:
    """Return how far a stem is off the simulated one, and which effect of its valve explains it."""
    op = run.stems[:, valve]
    constant, before = float(np.median(stem - op)), float(_left(stem, op[:, None])[0])
    off = float(np.sqrt(before / len(stem)))
    other = "the simulated one" if run.model.valves[valve].effects else "OP"
    said = f"it stands {off:.2g} % off {other}"
    if abs(constant) > off:
        said += f" about a constant {constant:.3g} %"
    if off <= NEGLIGIBLE * float(np.ptp(op)):
        return f"{said} and follows it, so that what the simulation misses lies behind the valve"
    lates = range(LONGEST_DELAY + 1)
    late = int(np.argmin([_left(stem[k:], op[: len(op) - k, None])[0] for k in lates]))
    if 0 < late < LONGEST_DELAY:
        said += f", and matches it best {late} samples later"
    explained = []
    for fit in fits:
        candidate = fit.candidate
        if isinstance(candidate, ValveCandidate) and candidate.valve == valve:
            tried = candidate.stems(run, fit.point[None, :], from_measured=True)
            left = float(_left(stem, tried)[0]) / max(before, 1e-300)
            explained.append((1.0 - left, candidate.behaviour(fit.point, fit.factors)))
    share, behaviour = max(explained, key=lambda each: each[0], default=(0.0, None))
    if behaviour is None or share <= MAJORITY:
        return f"{said}; no single effect of a valve explains that"
    figures = ", ".join(f"{k} {v:.3g}" for k, v in figures_of(behaviour).items())
    return f"{said}; {behaviour.title()} ({figures}) explains {100.0 * share:.0f} % of that"


def _left(stem: FloatArray, tried: FloatArray) -> FloatArray:
    """Return the squared distances of tried stems, constants taken out, shape (G,)."""
    away = tried - stem[:, None]
    return np.asarray(np.sum((away - away.mean(axis=0)) ** 2, axis=0))
