"""What is handed over of each effect: figures with units and intervals, and what it closes."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

from stiction_ros.discrepancy.candidate.base import figures_of
from stiction_ros.discrepancy.data.gate import DataFinding
from stiction_ros.discrepancy.decision.decide import GapVerdict
from stiction_ros.discrepancy.decision.explanation import AddedEffect
from stiction_ros.discrepancy.decision.probability import Name, Standing
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.uncertainty import Intervals
from stiction_ros.discrepancy.gap.measure import Shrunk, gone_share, rms
from stiction_ros.discrepancy.gap.noise_effects import NoiseEffect
from stiction_ros.discrepancy.likelihood.declared_noise import declared_noise
from stiction_ros.effects import Backlash, Behaviour, HeStiction
from stiction_ros.signals.autoregression import whiten


@dataclasses.dataclass(frozen=True)
class FoundEffect:
    """One effect that the simulation lacked."""

    place: str  # as loop models name it
    behaviour: Behaviour  # with its figures, times in seconds since the first sample
    delta_bic: float  # BIC by which it beats the model without it
    # 95 % of each parameter that has one
    intervals: Mapping[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    # share of the free-run excess that goes when it is added last; NaN where no free run shows it
    closed: float = math.nan
    verdict: GapVerdict = GapVerdict.NAMED  # named or ambiguous
    # places and effects that the record does not tell from it
    alternatives: tuple[tuple[str, str], ...] = ()
    sentence: str = ""  # why this effect was named, and not a rival
    stands: Standing | None = None  # how far it is ahead; None where ``delta_bic`` tells it

    @property
    def standing(self) -> Standing:
        """How far it is ahead, or one of those that are not told from it."""
        names = ((self.place, self.effect), *self.alternatives)
        return self.stands or Standing(self.delta_bic, names)

    @property
    def effect(self) -> str:
        """Name of the effect in a loop model."""
        return self.behaviour.effect

    @property
    def law(self) -> str | None:
        """Which of several laws of one effect; None where there is one."""
        return self.behaviour.law

    @property
    def parameters(self) -> Mapping[str, float]:
        """Its figures in engineering units."""
        return figures_of(self.behaviour)

    @property
    def units(self) -> Mapping[str, str]:
        """Units of the parameters; a valve's signal is in %."""
        kind, _, tag = self.place.partition(":")
        signal = "%" if kind in ("valve", "load") else f"units of {tag}"
        return {p.key: p.unit.replace("signal", signal) for p in self.behaviour.parameters()}

    @property
    def title(self) -> str:
        """Effect with its law, such as ``stiction (xch)``; the effect alone where it has one."""
        return self.effect if self.law is None else f"{self.effect} ({self.law})"

    def to_dict(self) -> dict[str, object]:
        """Return the entry of ``effects`` in ``gap --json``."""
        likely = self.standing.probabilities()
        return {
            "place": self.place,
            "effect": self.effect,
            **({} if self.law is None else {"law": self.law}),
            "parameters": dict(self.parameters),
            "units": dict(self.units),
            "intervals": {key: list(ends) for key, ends in self.intervals.items()},
            "delta_bic": self.delta_bic,
            "closed": None if math.isnan(self.closed) else self.closed,
            "verdict": self.verdict.value,
            "probability": likely[self.place, self.effect],
            "alternatives": listed_names(self.alternatives, likely),
            "sentence": self.sentence,
        }


def listed_names(names: Sequence[Name], probabilities: Mapping[Name, float]) -> list[object]:
    """Return an entry ``alternatives`` of ``gap --json``."""
    return [{"place": n[0], "effect": n[1], "probability": probabilities[n]} for n in names]


def of_data(finding: DataFinding) -> FoundEffect:
    """Return a finding of the values or of the record as an effect."""
    said = "The recorded values themselves show it, before any model is asked"
    return FoundEffect(finding.place, finding.behaviour, finding.delta_bic, sentence=said)


def of_noise(laws: Sequence[NoiseEffect], declared: float, margin: float) -> FoundEffect:
    """Return a noise larger than declared as an effect.

    Args:
        laws: that tell it, the best first.
        declared: score of the declared noise alone.
        margin: within which laws are not told apart.
    """
    best, *others = (each for each in laws if each.score < laws[0].score + margin)
    return FoundEffect(
        best.place,
        best.behaviour,
        declared - best.score,
        best.intervals,
        verdict=GapVerdict.AMBIGUOUS if others else GapVerdict.NAMED,
        alternatives=tuple((each.place, each.behaviour.effect) for each in others),
        sentence="What no other effect explains wanders without a relation to OP, more than the "
        "noise that the model declares",
    )


def own_closed(without: Baseline, base: Baseline, *, dated: bool, given: bool) -> float:
    """Return the share of the excess that is gone with an effect and not without it.

    Where an answer leaves the noise that the model declares, both free runs are whitened by that
    noise: noise of the equation wanders farther than most effects move PV. So they are where none
    is declared and the process is as it was given; one that was fitted may leave a memory of its
    own in what looks like noise. Where an answer leaves more than the declared noise,
    something else is missing: what is slow hides a quick effect in the free run, what is quick a
    slow one in one step. The larger share counts. What comes at one moment shows there alone in
    whitened rows, which may be fitted ones.

    Args:
        without: the model with all other effects.
        base: with the effect, too.
        dated: whether it comes at one moment.
        given: whether the process is the one that was given, and none that was fitted.
    """
    closed, quick = [], []
    for i, noise in enumerate(declared_noise(base.run.model)):
        old, new, blocks = without.noise[i], base.noise[i], base.blocks[i]
        before, after, rows = old.residual, new.residual, blocks.held
        floor = min(new.stationary_std, rms(after[blocks.train]))
        every = blocks.scored if dated else rows
        if (base.declared[i] or given) and not new.enlarged and len(new.ar):
            before, after = (whiten(each, new.ar) for each in (before, after))
            rows, floor = every, math.inf
        closed.append(Shrunk(rms(before[rows]), rms(after[rows]), floor, new.innovation_std))
        if noise is not None and new.enlarged:
            left, less = (rms(each.innovations[every]) for each in (old, new))
            quick.append(Shrunk(left, less, noise.std, noise.std))
    return max(gone_share(closed), gone_share(quick))


def without_its_jump(intervals: Intervals, effect: AddedEffect) -> Intervals:
    """Return the intervals of a stiction, wide enough for no jump where that is not told from one.

    Backlash is stiction whose f_S and f_D are both half of the band.
    """
    backlash = effect.place, Backlash.effect
    if effect.effect != HeStiction.effect or backlash not in effect.alternatives:
        return intervals
    static, dynamic = intervals["f_s"], intervals["f_d"]
    figures = figures_of(effect.behaviour)
    half = 0.5 * (figures["f_s"] + figures["f_d"])
    return {
        **intervals,
        "f_s": (min(static[0], half), static[1]),
        "f_d": (dynamic[0], max(dynamic[1], half)),
    }
