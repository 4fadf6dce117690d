"""After the looks: what may be said of what was found, and the answer as it is handed over."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Mapping

import numpy as np

from stiction_ros.discrepancy.answer.found_effects import (
    FoundEffect,
    holds_nothing_out,
    moved_by,
    of_data,
    of_noise,
    own_closed,
    units_of,
)
from stiction_ros.discrepancy.answer.results import Discrepancy, Look
from stiction_ros.discrepancy.answer.say import LEFT, called, experiment_for, overall, reason_for
from stiction_ros.discrepancy.answer.stem_words import look_at_stems
from stiction_ros.discrepancy.candidate.base import figures_of
from stiction_ros.discrepancy.data.controller_check import ControllerCheck
from stiction_ros.discrepancy.data.gate import DataFinding, Gate
from stiction_ros.discrepancy.decision.decide import GapVerdict
from stiction_ros.discrepancy.decision.extend import AddedEffect, base_beside, run_with
from stiction_ros.discrepancy.decision.scores import Progress
from stiction_ros.discrepancy.decision.testable import Testable
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.uncertainty import (
    Intervals,
    bootstrap_intervals,
    likelihood_intervals,
)
from stiction_ros.discrepancy.gap.measure import closed_share, measure_gap
from stiction_ros.discrepancy.gap.noise_check import OutputNoise, check_noise, noise_sentences
from stiction_ros.discrepancy.gap.noise_effects import NO_LAW, NoiseEffect, noise_effects
from stiction_ros.discrepancy.likelihood.declared_noise import declared_noise
from stiction_ros.discrepancy.options import GapOptions
from stiction_ros.discrepancy.process.change import ProcessChange
from stiction_ros.discrepancy.process.free_intervals import with_free_process
from stiction_ros.discrepancy.process.refit import with_noise_of
from stiction_ros.discrepancy.simulation.free_run import Runs
from stiction_ros.effects import from_mapping
from stiction_ros.loop import LoopModel

BESIDE = 0.2  # of the first gap, that is left as noise: less is no effect beside another one
A_ROW = 0.1  # of −2 log likelihood, that noise gains beside an effect: a twentieth of its σ
SOME_STEPS = 3.0  # of the rounding
CLOSES = 0.2  # of the excess of the free run that an effect has to close by itself


@dataclasses.dataclass(frozen=True)
class Ended:
    """What the looks left behind.

    Attributes:
        model: as it was given.
        options: of the run.
        gate, controller, data: what the data themselves show.
        runs: the records end to end.
        bare: the model without any effect that was added, its process mended.
        changes: what of the process was mended.
        longest: delay tried where the process is free, samples.
        before, base: free runs without and with what was added.
        added: effects that stayed.
        gains: BIC by which an effect beat the model, where the process is free.
        looks: the rounds.
        testable: what the last of them could have seen.
        random: source of the bootstraps.
        report: called with the share done.
        begun: of the clock, s.
    """

    model: LoopModel
    options: GapOptions
    gate: Gate
    controller: ControllerCheck
    data: tuple[DataFinding, ...]
    runs: Runs
    bare: LoopModel
    changes: tuple[ProcessChange, ...]
    longest: int
    before: Baseline
    base: Baseline
    added: tuple[AddedEffect, ...]
    gains: Mapping[tuple[str, str], float]
    looks: tuple[Look, ...]
    testable: tuple[Testable, ...]
    random: np.random.Generator
    report: Progress
    begun: float

    def beside(self, k: int) -> Baseline:
        """Return the baseline with all added effects but one."""
        return base_beside(self.bare, self.runs, [*self.added[:k], *self.added[k + 1 :]])

    def without(self, k: int) -> Ended:
        """Return the same with one effect less."""
        added = (*self.added[:k], *self.added[k + 1 :])
        base = Baseline.of(run_with(self.bare, self.runs, added))
        return dataclasses.replace(self, added=added, base=base)


def closing(ended: Ended) -> Discrepancy:
    """Return the answer: what holds as a name, and everything that belongs to it."""
    looked = ended
    ended, found = _named(looked)
    before, after = measure_gap(ended.before), measure_gap(ended.base)
    louder = _louder(ended)
    effects = [*(of_data(finding) for finding in ended.data), *found, *louder]
    verdict, alternatives = overall(effects, ended.looks, ended.testable)
    model = ended.bare
    for shown, added in zip(found, ended.added, strict=True):
        model = model.with_effect(added.place, added.behaviour, **_provenance(ended, shown))
    for noise in louder:
        behaviour = from_mapping({"effect": noise.effect} | dict(noise.parameters))
        model = model.with_effect(noise.place, behaviour, **_provenance(ended, noise))
    if ended.options.free_process:
        model = with_noise_of(model, ended.model)
    noises = check_noise(ended.base)
    kept = {e.fit.candidate.key for e in ended.added}
    no_names = [
        called(*e.fit.candidate.key) for e in looked.added if e.fit.candidate.key not in kept
    ]
    if verdict is GapVerdict.UNKNOWN and ended.changes and _mended(ended):
        verdict = effects[0].verdict if effects else GapVerdict.NONE
    silent = not effects and verdict in (GapVerdict.NONE, GapVerdict.UNTESTABLE)
    if silent and (no_names or _noise_left(ended, noises)):
        verdict = GapVerdict.UNKNOWN
    named = {(e.place, e.effect) for e in effects} | {n for e in effects for n in e.alternatives}
    named |= set(alternatives)
    ended.report(1.0)
    return Discrepancy(
        verdict=verdict,
        effects=tuple(effects),
        alternatives=alternatives,
        experiment=experiment_for(verdict, effects, alternatives, ended.testable),
        where=_where(ended, no_names, verdict),
        untestable=tuple(
            t for t in ended.testable if not t.testable and (t.place, t.effect) not in named
        ),
        noise=noises,
        process_changes=ended.changes,
        before=before,
        after=after,
        closed=closed_share(before, after) if ended.added or ended.changes else 0.0,
        model_before=ended.model,
        model_after=model,
        looks=ended.looks,
        gate=ended.gate,
        controller=ended.controller,
        runs=ended.runs,
        base_before=ended.before,
        base_after=ended.base,
        seconds=time.perf_counter() - ended.begun,
        notes=(*ended.gate.notes, *(n for r in ended.runs.records for n in r.notes)),
    )


def _where(ended: Ended, no_names: list[str], verdict: GapVerdict) -> tuple[str, ...]:
    """Return the sentences that say where the gap is, the stem's first.

    Where nothing is missed there is no such place; the noise may still be another than declared.
    """
    found: list[str] = []
    if verdict is not GapVerdict.NONE:
        found += [stem.sentence for stem in look_at_stems(ended.before.run)]
        found += [sentence for look in ended.looks[:1] for sentence in look.where.sentences]
    found += noise_sentences(check_noise(ended.before), ended.runs.sample_time)
    last = ended.looks[-1].decision
    if last.verdict is GapVerdict.UNKNOWN:
        found.append(last.reason)
    found += [f"{each} would fit, but its figures hold nothing out" for each in no_names]
    return tuple(found)


def _named(ended: Ended) -> tuple[Ended, list[FoundEffect]]:
    """Return what is left when effects that are no names are gone, and the names."""
    while True:
        found = [_effect(ended, k, effect) for k, effect in enumerate(ended.added)]
        no_name = [
            k
            for k, (shown, effect) in enumerate(zip(found, ended.added, strict=True))
            if holds_nothing_out(effect, ended.base, shown.intervals) or shown.closed < CLOSES
        ]
        if not no_name:
            return ended, found
        ended = ended.without(no_name[-1])


def _effect(ended: Ended, k: int, effect: AddedEffect) -> FoundEffect:
    without = ended.beside(k)
    return FoundEffect(
        effect.place,
        effect.effect,
        effect.behaviour.law,
        figures_of(effect.behaviour),
        units_of(effect.behaviour, effect.place),
        _intervals(ended, k, effect, without),
        ended.gains.get((effect.place, effect.effect), effect.fit.delta_bic),
        own_closed(without, ended.base),
        GapVerdict.AMBIGUOUS if effect.alternatives else GapVerdict.NAMED,
        effect.alternatives,
        reason_for(effect, ended.looks),
        moved_by(without, ended.base),
    )


def _intervals(ended: Ended, k: int, effect: AddedEffect, base: Baseline) -> Intervals:
    if ended.options.quick:
        found = likelihood_intervals(base, effect.fit)
    else:
        found = bootstrap_intervals(
            base, effect.fit, ended.options.resamples, ended.random, _share(ended, k)
        )
    if not ended.options.free_process:
        return found
    return with_free_process(found, base, effect.fit, ended.longest)


def _share(ended: Ended, k: int) -> Callable[[float], None]:
    done = ended.options.most_effects / (ended.options.most_effects + 1)
    part = (1.0 - done) / len(ended.added)
    return lambda share: ended.report(done + (k + share) * part)


def _louder(ended: Ended) -> list[FoundEffect]:
    """Return the noise beyond the declared one as effects."""
    found = []
    for i, declared in enumerate(declared_noise(ended.base.run.model)):
        fit = ended.base.noise[i]
        if declared is None or not fit.enlarged or _slowed(ended, i):
            continue
        if not _matters(ended, i):
            continue
        beside = ended.added or ended.changes
        laws = noise_effects(ended.base, i, declared, A_ROW if beside else 0.0)
        if laws and laws[0].score < fit.bic(0) + fit.held_minus_two_log - _stranger(ended, laws[0]):
            own = ended.base.under_declared(i)
            found.append(of_noise(laws, own.bic(0) + own.held_minus_two_log, ended.options.margin))
    return found


def _slowed(ended: Ended, output: int) -> bool:
    """Tell whether beside an effect the declared noise is left, which may have passed its lag."""
    fits = [effect.fit.noise for effect in ended.added]
    return any(output in noise and not noise[output].enlarged for noise in fits)


def _stranger(ended: Ended, law: NoiseEffect) -> float:
    """Return what an explanation gains that has no name, or one of a set that is left in doubt.

    A noise has to be worth as much to be named; what it is a name of is no rival of it.
    """
    last = ended.looks[-1]
    if last.decision.verdict is GapVerdict.UNKNOWN:
        name = law.place, law.behaviour.effect
        rivals = [f.evidence for f in last.scores.fits if name not in f.candidate.contains]
        return max([*rivals, -NO_LAW])
    if last.decision.chosen is not None and not last.kept:
        return last.decision.chosen.evidence
    return -NO_LAW


def _mended(ended: Ended) -> bool:
    """Tell whether the changed process took most of what was left without a name."""
    gained = ended.before.bic - ended.base.bic + ended.base.held_gain(ended.before)
    return max(fit.evidence for fit in ended.looks[-1].scores.fits) < LEFT * gained


def _noise_left(ended: Ended, noises: tuple[OutputNoise, ...]) -> bool:
    """Tell whether noise is left that no law tells, and that is large enough to matter."""
    return any(
        each.memory and (not ended.changes or _matters(ended, i)) for i, each in enumerate(noises)
    )


def _matters(ended: Ended, output: int) -> bool:
    """Tell whether what is left of an output is large enough to be an effect.

    A model of the field is never exact: beside a large effect it leaves a little of its own.
    Rounding of a slow signal is no white noise: what is left has to span some steps.
    """
    rows = ended.base.blocks[output].train
    before, after = (
        float(np.std(base.noise[output].residual[rows])) for base in (ended.before, ended.base)
    )
    if after < SOME_STEPS * ended.runs.quanta[output]:
        return False
    return not (ended.added or ended.changes) or after > BESIDE * before


def _provenance(ended: Ended, effect: FoundEffect) -> dict[str, object]:
    return {
        "what": effect.effect,
        "at": effect.place,
        "by": "stiction gap",
        "records": [record.name for record in ended.runs.records],
        "delta_bic": round(effect.delta_bic, 2),
        "verdict": effect.verdict.value,
        "alternatives": [f"{place} {name}" for place, name in effect.alternatives],
    } | ({} if math.isnan(effect.closed) else {"closed": round(effect.closed, 3)})
