"""After the looks: what may be said of what was found, and the answer as it is handed over."""

import math
import time

import numpy as np

from stiction_ros.discrepancy.answer.found_effects import (
    FoundEffect,
    of_data,
    of_noise,
    own_closed,
    without_its_jump,
)
from stiction_ros.discrepancy.answer.results import Discrepancy
from stiction_ros.discrepancy.answer.say import (
    called,
    experiment_for,
    overall,
    reason_for,
    stem_sentences,
)
from stiction_ros.discrepancy.decision.decide import GapVerdict, on_the_way, verdict_of
from stiction_ros.discrepancy.decision.explanation import AddedEffect
from stiction_ros.discrepancy.decision.probability import standing
from stiction_ros.discrepancy.decision.scores import testable_effects
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.uncertainty import (
    Intervals,
    bootstrap_intervals,
    likelihood_intervals,
    otherwise,
)
from stiction_ros.discrepancy.gap.measure import (
    OutputNoise,
    check_noise,
    closed_share,
    free_run_gap,
    noise_sentences,
)
from stiction_ros.discrepancy.gap.noise_effects import NO_LAW, NoiseEffect, noise_effects
from stiction_ros.discrepancy.likelihood.declared_noise import declared_noise
from stiction_ros.discrepancy.measures import MAJORITY, SLIGHT
from stiction_ros.discrepancy.process.change import open_figures
from stiction_ros.discrepancy.steps.look import explained
from stiction_ros.discrepancy.steps.settle import settle
from stiction_ros.discrepancy.steps.state import State, Task
from stiction_ros.effects import FloatArray

SOME_STEPS = 3.0  # of the rounding, that a noise which has a law has to span
MATTERS = 0.2  # of the gap, that an effect has to close by itself, and a noise that is left to be


def closing(task: Task, looked: State) -> Discrepancy:
    """Return the answer: what holds as a name, and everything that belongs to it."""
    state, found = _named(task, looked)
    if not explained(state):
        assert state.doubted is not None
        looked = settle(task, state.doubted)
        state, found = _named(task, looked)
    state, found, louder = _beside_noise(task, state, found)
    base = state.now.base
    before, after = free_run_gap(state.before), free_run_gap(base)
    shown, answers = [of_data(finding) for finding in task.data], [*found, *louder]
    effects = [*shown, *answers]
    gained = state.before.score - base.score + sum(noise.delta_bic for noise in louder)
    last, chosen = state.looks[-1].scores, state.looks[-1].decision.chosen
    testable = testable_effects(last.base, last.candidates, task.options.margin)
    verdict, alternatives = overall(shown, answers, state.looks, testable, gained)
    in_doubt = None
    if alternatives and not answers and chosen is not None:
        left = AddedEffect(chosen, alternatives, state.looks[-1].decision.fits)
        in_doubt = standing(left, state.now.effects)
    model = state.now.bare
    for named in answers:
        model = model.with_effect(named.place, named.behaviour, **_provenance(task, named))
    noises = check_noise(base)
    kept = {e.fit.candidate.key for e in state.now.effects}
    no_names = [
        called(*e.fit.candidate.key) for e in looked.now.effects if e.fit.candidate.key not in kept
    ]
    changes = tuple(change for change in state.now.changes if change.matters)
    silent = not effects and verdict in (GapVerdict.NONE, GapVerdict.UNTESTABLE)
    if silent and no_names:
        verdict = GapVerdict.UNKNOWN
    elif silent and changes:
        verdict = GapVerdict.NAMED
    told = {name for each in effects for name in each.standing.names} | {*alternatives}
    task.report(1.0)
    return Discrepancy(
        verdict=verdict,
        effects=tuple(effects),
        alternatives=alternatives,
        in_doubt=in_doubt,
        experiment=experiment_for(verdict, effects, alternatives, testable),
        where=_where(task, state, noises, no_names, verdict),
        untestable=tuple(t for t in testable if not t.testable and (t.place, t.effect) not in told),
        noise=noises,
        process_changes=changes,
        corrections=tuple(change for change in state.now.changes if not change.matters),
        before=before,
        after=after,
        closed=closed_share(before, after) if state.now.effects or state.now.changes else 0.0,
        model_before=task.model,
        model_after=model,
        looks=state.looks,
        gate=task.gate,
        controller=task.controller,
        runs=task.runs,
        base_before=state.before,
        base_after=base,
        seconds=time.perf_counter() - task.begun,
        notes=(*task.gate.notes, *(n for r in task.runs.records for n in r.notes)),
    )


def _where(
    task: Task,
    state: State,
    noises: tuple[OutputNoise, ...],
    no_names: list[str],
    verdict: GapVerdict,
) -> tuple[str, ...]:
    """Return the sentences that say where the gap is, the stem's first.

    Where nothing is missed there is no such place; where the first look found an effect, that says
    where. The noise may still be another than declared.
    """
    found: list[str] = []
    if verdict is not GapVerdict.NONE:
        first = state.looks[0]
        found += stem_sentences(state.before.run, first.scores.fits)
        found += () if first.kept else first.where.sentences
    found += noise_sentences(check_noise(state.before))
    if state.now.effects:
        left = noise_sentences(noises)
        found += [f"beside what was found, {sentence}" for sentence in left]
    last = state.looks[-1].decision
    if last.verdict is GapVerdict.UNKNOWN:
        found.append(last.reason)
    found += [f"{e.output}: {e.sentence}" for e in state.now.changes if not e.matters]
    found += [f"{each} would fit, but closes next to nothing of the gap" for each in no_names]
    return tuple(found)


def _named(task: Task, state: State) -> tuple[State, list[FoundEffect]]:
    """Return what is left when effects that are no names are gone, and the names."""
    while True:
        found = _found(task, state)
        no_name = [k for k, shown in enumerate(found) if shown.closed < MATTERS]
        if not no_name:
            return state, found
        state = state.holding(state.now.others(no_name[-1]))


def _found(task: Task, state: State) -> list[FoundEffect]:
    """Return what is told of every effect."""
    now = state.now
    without = [now.beside(k) for k in range(len(now.effects))]
    moved: list[list[FloatArray]] = []
    if len(without) > 1:
        pairs = zip(without, now.effects, strict=True)
        moved = [otherwise(base, effect.fit) for base, effect in pairs]
    slopes = [list(now.slopes)] if now.slopes else []
    if task.options.process_fitted:
        slopes = [open_figures(now.base.run)]
    found = []
    for k, effect in enumerate(now.effects):
        others = [*moved[:k], *moved[k + 1 :], *slopes]
        beside = [np.hstack(columns) for columns in zip(*others, strict=True)]
        fitted = task.options.process_fitted
        dated = effect.fit.candidate.dated
        told = FoundEffect(
            effect.place,
            effect.behaviour,
            effect.fit.delta_bic,
            _intervals(task, state, k, without[k], beside),
            own_closed(without[k], now.base, dated=dated, given=not fitted),
            verdict_of(effect.effect, effect.alternatives),
            effect.alternatives,
            reason_for(effect, state.looks),
            standing(effect, now.others(k)),
        )
        found.append(told)
    return found


def _intervals(
    task: Task, state: State, k: int, base: Baseline, beside: list[FloatArray]
) -> Intervals:
    """Return those of the k-th effect, by the model with all others.

    Beside it is, per output, what these and a changed process would do by other figures.
    """
    effect, options = state.now.effects[k], task.options
    if options.quick:
        return without_its_jump(likelihood_intervals(base, effect.fit, beside), effect)
    done = options.most_effects / (options.most_effects + 1)
    part = (1.0 - done) / len(state.now.effects)

    def report(share: float) -> None:
        task.report(done + (k + share) * part)

    found = bootstrap_intervals(base, effect.fit, options.resamples, task.random, report, beside)
    return without_its_jump(found, effect)


def _beside_noise(
    task: Task, state: State, found: list[FoundEffect]
) -> tuple[State, list[FoundEffect], list[FoundEffect]]:
    """Return what is left without effects that only stand for a larger noise, and that noise."""
    louder = _louder(task, state)
    if not louder:
        return state, found, louder
    worth = _worth(task, state, louder)
    for k in range(len(found)):
        other = state.holding(state.now.others(k))
        alone = _louder(task, other)
        if alone and _worth(task, other, alone) <= worth:
            return _beside_noise(task, *_named(task, other))
    return state, found, louder


def _worth(task: Task, state: State, louder: list[FoundEffect]) -> float:
    """Return the worth of an explanation under the laws of its noise in place of the larger one."""
    now, base = state.now, state.now.base
    given = now.worth(task.options.margin) + base.score_under_declared - base.score
    return given - sum(each.delta_bic for each in louder)


def _louder(task: Task, state: State) -> list[FoundEffect]:
    """Return the noise beyond the declared one as effects."""
    found: list[FoundEffect] = []
    now, base = state.now, state.now.base
    for i, declared in enumerate(declared_noise(base.run.model)):
        fit = base.noise[i]
        if declared is None or not fit.enlarged or not _matters(state, i):
            continue
        least = 2.0 * SLIGHT if now.effects or now.changes else 0.0  # a row, by a larger σ
        laws = noise_effects(base, i, declared, least)
        if laws and laws[0].score < fit.bic(0) + fit.held_minus_two_log - _stranger(state, laws[0]):
            own = base.under_declared(i)
            found.append(of_noise(laws, own.bic(0) + own.held_minus_two_log, task.options.margin))
    return found


def _stranger(state: State, law: NoiseEffect) -> float:
    """Return what an explanation gains that has no name, or one of a set that is left in doubt.

    A noise has to be worth as much to be named; what it is a name of is no rival of it.
    """
    last = state.looks[-1]
    if last.decision.verdict is GapVerdict.UNKNOWN:
        name = law.place, law.behaviour.effect
        rivals = [f.evidence for f in last.scores.fits if name not in f.candidate.contains]
        return max([*rivals, -NO_LAW])
    if last.decision.chosen is not None and not last.kept:
        return last.decision.chosen.evidence
    return -NO_LAW


def _matters(state: State, output: int) -> bool:
    """Tell whether what is left of an output is large enough to be an effect.

    No valve and no plant obeys its law to the letter: beside an effect on the way from OP to PV it
    has to be most of the gap, as what a law misses wanders as a noise does. Beside another large
    effect a model leaves a little of its own. Rounding of a slow signal is no white noise: within a
    few steps no law of the noise is told.
    """
    now = state.now
    rows = now.base.blocks[output].train
    before, after = (
        float(np.std(base.noise[output].residual[rows])) for base in (state.before, now.base)
    )
    on_way = any(on_the_way(each.place, each.effect) for each in now.effects)
    least = math.sqrt(MAJORITY) if on_way else MATTERS if now.effects or now.changes else 0.0
    return after >= SOME_STEPS * now.runs.quanta[output] and after > least * before


def _provenance(task: Task, effect: FoundEffect) -> dict[str, object]:
    return {
        "what": effect.effect,
        "at": effect.place,
        "by": "stiction gap",
        "records": [record.name for record in task.runs.records],
        "delta_bic": round(effect.delta_bic, 2),
        "verdict": effect.verdict.value,
        "alternatives": [f"{place} {name}" for place, name in effect.alternatives],
    } | ({} if math.isnan(effect.closed) else {"closed": round(effect.closed, 3)})
