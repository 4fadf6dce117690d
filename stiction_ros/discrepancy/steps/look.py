"""One look: every candidate scored, one effect added if the scores allow a name for it."""

import dataclasses
from collections.abc import Sequence
from typing import cast

import numpy as np

from stiction_ros.discrepancy.answer.results import Look
from stiction_ros.discrepancy.candidate.valve import departures
from stiction_ros.discrepancy.decision.decide import (
    Decision,
    GapVerdict,
    borne_out,
    decide,
    left_of_stem,
    not_contradicted,
    told_by_stem,
)
from stiction_ros.discrepancy.decision.explanation import (
    AddedEffect,
    Explanation,
    left_open,
    refit_together,
)
from stiction_ros.discrepancy.decision.scores import Scores, all_candidates, score_candidates
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.gap.where import locate
from stiction_ros.discrepancy.measures import MAJORITY, TURNS
from stiction_ros.discrepancy.process.change import open_figures, refitted_process
from stiction_ros.discrepancy.steps.state import State, Task
from stiction_ros.discrepancy.steps.wholes import changed_again, process_first

SCORES = ("scores",)  # of a model as it is, by name


def look_on(task: Task, state: State) -> State:
    """Look until nothing more is found.

    An effect that is in doubt with others is added for a while: its rivals may be near only beside
    what is not yet in the model. So is one that gains most and that the held-out rows refuse: what
    is not yet in the model may be why. Where nothing more is found, or all together leaves more
    than the declared noise, it is taken back.
    """
    for k in range(len(state.now.effects), task.options.most_effects):
        state = look(task, state, k)
        if not state.looks[-1].kept:
            break
    if not explained(state):
        assert state.doubted is not None
        state = state.doubted
    return state


def look(task: Task, state: State, k: int) -> State:
    """Look for one effect more: the k-th, from 0."""
    scores = scored_by(task, state, k)
    mended = process_first(task, state, scores)
    if mended is not None:
        return look(task, mended, k)
    decision = decided(task, state, scores)
    grown, reason = _extended(task, state, decision)
    kept = grown is not None
    own = Look(scores, decision, locate(scores.base), kept, reason)
    seen = dataclasses.replace(state, looks=(*state.looks, own))
    if grown is None:
        return seen
    given_up = dataclasses.replace(own, kept=False, reason=decision.reason)
    refused = dataclasses.replace(seen, looks=(*state.looks, given_up))
    doubted = state.doubted or (None if decision.inseparable else refused)
    again = changed_again(task, dataclasses.replace(seen, now=grown), grown.effects)
    return dataclasses.replace(seen, now=again or grown, doubted=doubted)


def explained(state: State) -> bool:
    """Tell whether an effect in doubt, with another one, explains more than it leaves.

    What is left is what any noise would still gain over the declared one. Alone, or where most is
    left, it may stand for what nobody has named yet.
    """
    if state.doubted is None:
        return True
    base, before = state.now.base, state.doubted.now.base
    if len(state.now.effects) < 2:
        return False
    gained = before.score - base.score
    refused = state.doubted.looks[-1]
    if refused.decision.lent is not None:
        rivals = [fit.evidence for fit in refused.scores.fits if not fit.candidate.inside]
        if gained < max(rivals, default=0.0):
            return False
        if not _borne_out(before, base, dated=False):
            return False
    return gained > max(base.score_under_declared - base.score, 0.0)


def scored_by(task: Task, state: State, k: int) -> Scores:
    """Score every candidate against the model as it is after k looks."""
    share = 1.0 / (task.options.most_effects + 1)
    now, fitted = state.now, task.options.process_fitted
    base = now.base
    if now.effects or fitted:
        slopes = now.tangents()
        if fitted:
            own = open_figures(base.run)
            slopes = [np.hstack(pair) for pair in zip(slopes, own, strict=True)]
        base = left_open(base.run, now.effects, slopes)
    candidates = all_candidates(base, task.controller.clock_known)
    if fitted:
        candidates = tuple(each for each in candidates if not each.absorbed)

    def report(done: float) -> None:
        task.report((k + done) * share)

    beside = left_open(now.base.run, now.effects, now.slopes) if now.slopes else None
    known = base.known if beside is None else {}
    if SCORES not in known:
        known[SCORES] = score_candidates(base, candidates, report, beside=beside)
    return cast("Scores", known[SCORES])


def decided(task: Task, state: State, scores: Scores) -> Decision:
    """Return what the scores allow to say."""
    base = scores.base
    possible = not_contradicted(base.run, scores.fits)
    allowed = [fit for fit in possible if not state.now.tells(fit)]

    def rests(fit: CandidateFit) -> int:
        return departures(base.run, fit.candidate, fit.point)

    decision = decide(allowed, task.options.margin, rests)
    if task.options.process_fitted:
        decision = _in_doubt_of_place(base, decision)
    decision = told_by_stem(base.run, decision, allowed)
    return dataclasses.replace(decision, fits=tuple(allowed))


def _extended(task: Task, state: State, decision: Decision) -> tuple[Explanation | None, str]:
    """Return the explanation with the chosen effect; None where there is none, and why."""
    chosen, now, fitted = decision.chosen, state.now, task.options.process_fitted
    lent = chosen is None and state.doubted is None and not fitted
    if lent:
        chosen = decision.lent
    if chosen is None or (fitted and not decision.inseparable):
        return None, decision.reason
    effects: Sequence[AddedEffect]
    effects = (*now.effects, AddedEffect(chosen, decision.alternatives, decision.fits))
    process = changed_again(task, state, effects)
    if process is None:
        process = now
    else:
        effects = process.effects
    for _ in range(TURNS if fitted else 0):
        bare = refitted_process(process.bare, task.runs, effects)
        process = dataclasses.replace(process, bare=bare)
        effects = refit_together(bare, task.runs, effects)
    grown = process.extended(effects)
    dated = grown.effects[-1].fit.candidate.dated
    if lent or _borne_out(now.base, grown.base, dated=dated):
        return grown, ""
    return None, "the innovations of the held-out rows do not become smaller"


def _borne_out(before: Baseline, after: Baseline, *, dated: bool) -> bool:
    """Tell whether the held-out rows bear out what lies between two models."""
    return borne_out(before.bic - after.bic, after.held_gain(before), dated)


def _in_doubt_of_place(base: Baseline, decision: Decision) -> Decision:
    """Return the decision, a static curve of the valve left in doubt with one of the process.

    A fitted linear process behind a curve and a curved process behind a linear valve give the
    same record, so that neither may be added. A recorded stem may confirm the curve.
    """
    if decision.chosen is None or not decision.chosen.candidate.about.bends:
        return decision
    if left_of_stem(base.run, decision.chosen) < MAJORITY:
        return decision
    _, _, valve = decision.chosen.candidate.place.partition(":")
    names = base.run.model.outputs
    curves = [(f"process:{names[i]}", "gain") for i in sorted(decision.chosen.noise)]
    return dataclasses.replace(
        decision,
        verdict=GapVerdict.AMBIGUOUS,
        alternatives=tuple(dict.fromkeys([*decision.alternatives, *curves])),
        inseparable=False,
        reason=f"a bend between OP of {valve} and PV may be the valve's or the process's",
    )
