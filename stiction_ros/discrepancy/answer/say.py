"""Step 6: one word for all looks, the experiment that would say more, and what stems say alone."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.answer.found_effects import FoundEffect
from stiction_ros.discrepancy.answer.results import Look
from stiction_ros.discrepancy.candidate.base import figures_of
from stiction_ros.discrepancy.candidate.output import LONGEST_DELAY
from stiction_ros.discrepancy.candidate.valve import ValveCandidate
from stiction_ros.discrepancy.decision.decide import GapVerdict
from stiction_ros.discrepancy.decision.explanation import AddedEffect
from stiction_ros.discrepancy.decision.scores import Testable
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.measures import MAJORITY
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Behaviour, FloatArray, about

LEFT = 0.4  # of the last effect's score: what may stay unexplained beside a name
ACCURATE = 0.01  # of the span of OP: a stem that near follows it


def overall(
    shown: Sequence[FoundEffect],
    effects: Sequence[FoundEffect],
    looks: Sequence[Look],
    testable: Sequence[Testable],
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
    """
    verdict, alternatives = _of_looks(effects, looks, testable)
    if shown and not effects and verdict in (GapVerdict.NONE, GapVerdict.UNTESTABLE):
        return GapVerdict.NAMED, ()
    return verdict, alternatives


def _of_looks(
    effects: Sequence[FoundEffect], looks: Sequence[Look], testable: Sequence[Testable]
) -> tuple[GapVerdict, tuple[tuple[str, str], ...]]:
    last = looks[-1].decision
    alternatives = [name for effect in effects for name in effect.alternatives]
    open_set = last.verdict is GapVerdict.AMBIGUOUS and not last.inseparable
    if not effects:
        if open_set and last.chosen is not None:
            if any(noise.enlarged for noise in last.chosen.noise.values()):
                return GapVerdict.UNKNOWN, ()
            names = [*last.chosen.candidate.keys, *last.alternatives]
            return GapVerdict.AMBIGUOUS, tuple(dict.fromkeys(names))
        if last.verdict is GapVerdict.UNKNOWN:
            return GapVerdict.UNKNOWN, ()
        if last.chosen is not None and not looks[-1].kept:
            return GapVerdict.NONE, ()
        if not any(t.testable for t in testable if t.place.startswith(("valve:", "process:"))):
            return GapVerdict.UNTESTABLE, ()
        return GapVerdict.NONE, ()
    if last.verdict is GapVerdict.UNKNOWN and _much_left(effects, looks[-1]):
        return GapVerdict.UNKNOWN, tuple(alternatives)
    return effects[0].verdict, tuple(dict.fromkeys(alternatives))


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
    names = {effect for _, effect in alternatives}
    names |= {effect.effect for effect in effects if effect.alternatives}
    told = (about(name).separation for name in sorted(names))
    hints = dict.fromkeys(text for text in told if text)
    return "; ".join(hints) or "move the set-point in larger steps and record the stem position"


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
    words = {
        "valve": f"{effect} of valve {tag}",
        "load": f"{effect} of the load at {tag}",
        "process": f"{effect} of the process to {tag}",
        "disturbance": f"{effect} of a disturbance on {tag}",
        "sensor": f"{effect} of the sensor of {tag}",
    }
    return words.get(kind, effect)


def _much_left(effects: Sequence[FoundEffect], look: Look) -> bool:
    outside = [fit for fit in look.scores.fits if not fit.candidate.inside]
    left = max((fit.delta_bic for fit in outside), default=0.0)
    return left > LEFT * max(effect.delta_bic for effect in effects)


@dataclasses.dataclass(frozen=True)
class StemLook:
    """A recorded stem against OP."""

    valve: str  # tag
    off: float  # root mean square of stem less where the model has it, %, a constant taken out
    constant: float  # that constant, %
    moved: bool  # whether the model moves it by anything but OP
    late: int  # samples by which the stem matches that best; 0 as well where it may be more
    # the effect of the valve that explains most of the distance; None where none explains enough
    behaviour: Behaviour | None
    share: float  # of the squared distance that it explains, 0 to 1
    span: float  # of OP, %

    @property
    def sentence(self) -> str:
        """What it says, for people."""
        other = "the simulated one" if self.moved else "OP"
        head = f"the stem of {self.valve} is recorded: it stands {self.off:.2g} % off {other}"
        if abs(self.constant) > self.off:
            head += f" about a constant {self.constant:.3g} %"
        if self.off <= ACCURATE * self.span:
            return (
                f"{head} and follows it, so that what the simulation misses lies behind the valve"
            )
        if self.late:
            head += f", and matches it best {self.late} samples later"
        if self.behaviour is None:
            return f"{head}; no single effect of a valve explains that"
        figures = ", ".join(f"{k} {v:.3g}" for k, v in figures_of(self.behaviour).items())
        share = f"{100.0 * self.share:.0f} %"
        return f"{head}; {self.behaviour.title()} ({figures}) explains {share} of that"


def look_at_stems(run: FreeRun, fits: Sequence[CandidateFit]) -> tuple[StemLook, ...]:
    """Return what every stem says that is recorded throughout, effects as they fit PV."""
    if any(record.stem is None for record in run.runs.records):
        return ()
    return tuple(_look(run, j, fits) for j in range(len(run.model.valves)))


def _look(run: FreeRun, valve: int, fits: Sequence[CandidateFit]) -> StemLook:
    name = run.model.valve_names[valve]
    parts = []
    for record in run.runs.records:
        assert record.stem is not None
        parts.append(record.stem[:, record.valves.index(name)])
    stem = np.concatenate(parts)
    op = run.stems[:, valve]
    constant = float(np.median(stem - op))
    before = _left(stem, op[:, None])[0]
    best, share = None, MAJORITY
    for fit in fits:
        candidate = fit.candidate
        if not isinstance(candidate, ValveCandidate) or candidate.valve != valve:
            continue
        tried = candidate.stems(run, fit.point[None, :], from_measured=True)
        gone = 1.0 - float(_left(stem, tried)[0]) / max(float(before), 1e-300)
        if gone > share:
            best, share = fit.behaviour, gone
    lates = range(LONGEST_DELAY + 1)
    shifted = [_left(stem[late:], op[: len(op) - late, None])[0] for late in lates]
    late = int(np.argmin(shifted))
    return StemLook(
        name,
        float(np.sqrt(before / len(stem))),
        constant,
        bool(run.model.valves[valve].effects),
        late if late < LONGEST_DELAY else 0,
        best,
        share if best is not None else 0.0,
        float(np.ptp(op)),
    )


def _left(stem: FloatArray, tried: FloatArray) -> FloatArray:
    """Return the squared distances of tried stems, constants taken out, shape (G,)."""
    away = tried - stem[:, None]
    return np.asarray(np.sum((away - away.mean(axis=0)) ** 2, axis=0))
