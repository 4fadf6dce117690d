"""Steps 5 and 6: the verdict by the scores, and the veto of a recorded stem."""

import dataclasses
import enum
import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.discrepancy.candidate.valve import ValveCandidate
from stiction_ros.discrepancy.candidate.wave import LOAD, StepCandidate
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.measures import MAJORITY, MARGIN, OFTEN, SLIGHT, SURE
from stiction_ros.discrepancy.simulation.free_run import HELD_SHARE, FreeRun
from stiction_ros.effects import Backlash, Stiction, about

JUMP_ABSENT = 5.0
"""BIC by which there is no jump: of the 7 that its figure costs in 1500 samples chance gains 2."""
FRICTION = "friction"  # families of effects
LAGS = "lag"
DOUBTFUL = 3.0  # standard deviations
EQUAL = 1.0  # BIC by which two explanations differ that are one


class GapVerdict(enum.StrEnum):
    """What the workflow says.

    ``NONE``: no effect beats the current model. ``NAMED``: one does, and its rivals.
    ``AMBIGUOUS``: one of a set does. ``UNKNOWN``: there is a gap, but the catalogue does not
    explain it. ``UNTESTABLE``: the record could not show the effects.

    Examples:
        >>> from stiction_ros import GapVerdict
        >>> GapVerdict("named") is GapVerdict.NAMED
        True
    """

    NONE = "none"
    NAMED = "named"
    AMBIGUOUS = "ambiguous"
    UNKNOWN = "unknown"
    UNTESTABLE = "untestable"


@dataclasses.dataclass(frozen=True)
class Decision:
    """What the scores of one look say."""

    verdict: GapVerdict  # none, named, ambiguous or unknown
    chosen: CandidateFit | None  # the best candidate of the catalogue, or None
    alternatives: tuple[tuple[str, str], ...]  # places and effects that cannot be told from it
    # whether the alternatives are its twins or its family, so that adding it serves for all of them
    inseparable: bool
    reason: str  # one sentence
    # of an unknown gap, the candidate that gains most and that the held-out rows refuse: what is
    # not yet in the model may be why. None where there is none
    lent: CandidateFit | None = None
    # of all candidates that were allowed
    fits: tuple[CandidateFit, ...] = dataclasses.field(default=(), compare=False, repr=False)


def decide(
    fits: Sequence[CandidateFit], margin: float, departures: Callable[[CandidateFit], int]
) -> Decision:
    """Return what may be said.

    Args:
        fits: of all candidates.
        margin: evidence, in BIC, by which the best must beat the current model, and its rivals
            outside its family.
        departures: how often the stem of a fit leaves a rest.
    """
    ranked = sorted(fits, key=lambda fit: -fit.evidence)
    passed = [f for f in ranked if f.candidate.inside and f.evidence >= margin and large_enough(f)]
    kept = [f for f in passed if confirmed(f)]
    outside = [f for f in ranked if not f.candidate.inside and confirmed(f)]
    stranger = outside[0] if outside else None
    sure = bool(passed) and passed[0].evidence >= margin + SURE
    refused = passed[0] if sure and not confirmed(passed[0]) else None
    beaten = refused and stranger and refused.evidence <= stranger.evidence
    lent = None if beaten else refused
    if not kept:
        if stranger is not None and stranger.evidence >= 2.0 * margin:
            return _unknown(stranger, "nothing in the catalogue explains the gap", lent)
        if refused is not None:
            return _unknown(refused, "the held-out rows do not confirm it", lent)
        reason = "the held-out rows do not confirm it" if passed else "nothing beats no effect"
        return Decision(GapVerdict.NONE, None, (), False, reason)
    best = kept[0]
    if lent is not None and lent.evidence > best.evidence + margin:
        reason = f"the held-out rows do not confirm {lent.candidate.name}, which gains most"
        return Decision(GapVerdict.UNKNOWN, None, (), False, reason, lent)
    if (
        stranger is not None
        and stranger.evidence > best.evidence + EQUAL
        and not _part(best, stranger)
    ):
        return _unknown(stranger, f"{best.candidate.name} explains less of the gap", lent)
    if _lags(best):  # told as the order of the process, where nothing speaks for another place
        orders = [f for f in kept if _lags(f) and f.candidate.place.startswith("process:")]
        best = next((f for f in orders if _as_much(f, best)), best)
    best, family = friction_kind(best, ranked, departures)
    rivals = [
        f
        for f in ranked
        if f.candidate.inside
        and f.candidate.key != best.candidate.key
        and f.evidence > max(best.evidence - _apart(f, best, margin), 0.0)
        and large_enough(f)
        and not _same_family(f, best)
    ]
    own, twins = [*family, *best.candidate.twins], [f.candidate.twins for f in rivals]
    own += [f.candidate.key for f in rivals]
    names = tuple(dict.fromkeys(itertools.chain(own, *twins)))
    if names:
        reason = "OP and PV do not tell them apart"
        one_family = all(  # or the same effect at another place explains all, as a sine's load does
            (_lags(f) and _lags(best))
            or (f.candidate.effect == best.candidate.effect and _as_much(f, best))
            for f in rivals
        )
        return Decision(GapVerdict.AMBIGUOUS, best, names, one_family, reason)
    return Decision(GapVerdict.NAMED, best, (), True, "it beats no effect and its rivals")


def confirmed(fit: CandidateFit) -> bool:
    """Tell whether the held-out rows bear an effect out, chance allowed for."""
    return borne_out(fit.delta_bic, fit.held_gain, fit.candidate.dated)


def borne_out(delta_bic: float, held_gain: float, dated: bool) -> bool:
    """Tell whether held-out rows bear out what the training rows gain.

    An effect that is there gains a third as much on the third as many rows, in the mean; the
    gain S of a known wave has the standard deviation 2 √S. Below nought, and by more than
    three of these below what is due, the held-out rows refuse it. What comes at one moment
    shows in the block of that moment, the other blocks gain nothing but chance.
    """
    if dated:
        return held_gain > -MARGIN
    due = max(delta_bic, 0.0) / (HELD_SHARE - 1)
    return held_gain > min(0.0, due - DOUBTFUL * 2.0 * math.sqrt(due))


def large_enough(fit: CandidateFit) -> bool:
    """Tell whether an effect has an engineering size, inside of what was searched."""
    if fit.candidate.at_bound(fit.point):
        return False
    return fit.candidate.large_enough(fit.point, fit.factors)


def on_the_way(place: str, effect: str) -> bool:
    """Tell whether an effect changes what OP does to PV."""
    return place.startswith(("valve:", "process:")) or (
        place.startswith("sensor:") and about(effect).family == LAGS
    )


def _unknown(stranger: CandidateFit, reason: str, lent: CandidateFit | None) -> Decision:
    said = f"{stranger.candidate.name} would explain the gap by {stranger.evidence:.0f}; {reason}"
    return Decision(GapVerdict.UNKNOWN, None, (), False, said, lent)


def _part(fit: CandidateFit, stranger: CandidateFit) -> bool:
    """Tell whether a fit is most of what a rival outside the catalogue contains."""
    part = fit.candidate.key in stranger.candidate.contains
    return part and fit.evidence > stranger.candidate.most_of * stranger.evidence


def _apart(fit: CandidateFit, best: CandidateFit, margin: float) -> float:
    """Return the evidence by which two effects are told apart.

    Two lags of one path are one law: what tells them is where they begin and how they are sampled.
    """
    return max(margin, SLIGHT * best.evidence) if _lags(fit) and _lags(best) else margin


def _lags(fit: CandidateFit) -> bool:
    return fit.candidate.about.family == LAGS


def _as_much(fit: CandidateFit, best: CandidateFit) -> bool:
    return abs(best.evidence - fit.evidence) < EQUAL


def verdict_of(effect: str, alternatives: Sequence[tuple[str, str]]) -> GapVerdict:
    """Return named for an effect without alternatives, or with the same law at other places.

    A lag does the same to PV wherever it is on the way: what the model lacks is told.
    """
    lags = about(effect).family == LAGS
    one_law = all(lags and about(name).family == LAGS for _, name in alternatives)
    return GapVerdict.NAMED if one_law else GapVerdict.AMBIGUOUS


def _same_family(one: CandidateFit, other: CandidateFit) -> bool:
    friction = one.candidate.about.family == other.candidate.about.family == FRICTION
    return friction and one.candidate.place == other.candidate.place


def friction_kind(
    best: CandidateFit, ranked: Sequence[CandidateFit], departures: Callable[[CandidateFit], int]
) -> tuple[CandidateFit, tuple[tuple[str, str], ...]]:
    """Return stiction or backlash by the test of the jump, and the other one in doubt.

    Args:
        best: any fit; what is no friction is returned as it is.
        ranked: all fits, the best one first.
        departures: how often the stem of a fit leaves a rest.
    """
    if best.candidate.about.family != FRICTION:
        return best, ()
    rivals = [f for f in ranked if _same_family(f, best) and f.evidence > 0.0 and confirmed(f)]
    jumping = [f for f in rivals if f.candidate.effect == Stiction.effect]
    plain = [f for f in rivals if f.candidate.effect == Backlash.effect]
    if not jumping or not plain:
        return best, ()
    jump = jumping[0].evidence - plain[0].evidence
    if best.evidence < MARGIN + SURE:  # too little to tell whether there is a jump
        other = jumping[0] if best.candidate.effect == Backlash.effect else plain[0]
        return best, (other.candidate.key,)
    if jump > MARGIN and jumping[0].candidate.leaps(jumping[0].point):
        return jumping[0], ()
    if jump < -JUMP_ABSENT and departures(plain[0]) >= OFTEN:
        return plain[0], ()
    first, second = (jumping[0], plain[0]) if jump > 0.0 else (plain[0], jumping[0])
    return first, (second.candidate.key,)


def left_of_stem(run: FreeRun, fit: CandidateFit) -> float:
    """Return the share of a stem's squared distance from the measured one that a fit leaves.

    1 of what is no effect of a valve, and where no stem is recorded. The step of a load is taken
    as that of a stem, its twin.
    """
    candidate, point = fit.candidate, fit.point[None, :]
    if isinstance(candidate, ValveCandidate):
        valve = candidate.valve
        stems = candidate.stems(run, point, from_measured=True)[:, 0]
    elif isinstance(candidate, StepCandidate) and candidate.place.startswith(LOAD):
        valve = candidate.index
        stems = run.stems[:, valve] + candidate.columns(run, point)[:, 0] @ fit.factors
    else:
        return 1.0
    measured = run.runs.stem(run.model.valve_names[valve])
    before, after = (
        float(np.nansum((each - measured) ** 2)) for each in (run.stems[:, valve], stems)
    )
    return after / before if before > 0.0 else 1.0 + after


def not_contradicted(run: FreeRun, fits: Sequence[CandidateFit]) -> list[CandidateFit]:
    """Return the fits but for those whose stem is further from the measured one than now."""
    return [
        fit
        for fit in fits
        if not isinstance(fit.candidate, ValveCandidate) or left_of_stem(run, fit) <= 1.0
    ]


def told_by_stem(run: FreeRun, decision: Decision, fits: Sequence[CandidateFit]) -> Decision:
    """Return what holds of a decision where recorded stems take part in it.

    A lag is of the valve where its stem comes as late, and of nothing behind the valve; where the
    stem does not, it is none of the valve's. So with all other effects of a valve that are left in
    doubt. Of several, those go whose stem is more than twice as far off as the nearest one.
    """
    chosen = decision.chosen
    if chosen is None or not decision.alternatives or not run.runs.stems_recorded:
        return decision
    names = {chosen.candidate.key, *decision.alternatives}
    at_valve = {name for name in names if name[0].startswith("valve:")}
    ranked = sorted(fits, key=lambda fit: fit.evidence)
    by_name = {key: fit for fit in ranked for key in reversed(fit.candidate.keys)}
    left = {name: left_of_stem(run, by_name[name]) for name in at_valve if name in by_name}
    bound = min(MAJORITY, min(left.values(), default=1.0) / MAJORITY)
    kept = {name for name in left if left[name] <= bound} or names - at_valve
    able = [by_name[name] for name in kept if name in by_name]
    if not able:
        return decision
    first = max(able, key=lambda fit: fit.evidence)
    others = tuple(n for n in decision.alternatives if n in kept and n != first.candidate.key)
    if chosen.candidate.key in kept and chosen is not first:
        others = (*others, chosen.candidate.key)
    verdict = GapVerdict.AMBIGUOUS if others else GapVerdict.NAMED
    reason = decision.reason if others else "the recorded stem tells it from its rivals"
    inseparable = decision.inseparable or not others
    return Decision(verdict, first, others, inseparable, reason)
