"""Which friction it is, told again when everything else is in the model."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from stiction_ros.discrepancy.candidate.valve import departures
from stiction_ros.discrepancy.decision.decide import FRICTION, friction_kind
from stiction_ros.discrepancy.decision.extend import AddedEffect, refit_together
from stiction_ros.discrepancy.decision.scores import all_candidates
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.search import CandidateFit, fit_candidate
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.discrepancy.steps.state import State, Task
from stiction_ros.discrepancy.steps.wholes import whole
from stiction_ros.effects import about

MANY = 0.2  # of the values, that were held or interpolated


def rests_left(run: FreeRun) -> Callable[[CandidateFit], int]:
    """Return what counts how often the stem of a fit leaves a rest, as far as PV shows it.

    Where many values were thinned out, PV does not show how a stem leaves its rest.
    """
    if max(run.runs.thinned) > MANY:
        return lambda fit: 0
    return lambda fit: departures(run, fit.candidate, fit.point)


def friction_told_again(task: Task, state: State) -> State:
    """Test for the jump of sticky valves again, with what was found later in the model."""
    for k, effect in enumerate(state.added):
        if about(effect.effect).family == FRICTION:
            told = _told(task, state, k)
            added = (*state.added[:k], told, *state.added[k + 1 :])
            state = dataclasses.replace(state, added=added)
    return state.with_added(task.runs, state.added)


def friction_beside_others(task: Task, state: State) -> State:
    """Return the state with another friction, where all effects fitted anew explain more with it.

    A friction that was told alone has figures that make up for what was not yet in the model, and
    what came next was fitted beside it: held-out rows may refuse the true one until both are moved.
    """
    for k, effect in enumerate(state.added):
        if about(effect.effect).family == FRICTION:
            state = _better_beside_others(task, state, k)
    return state


def _better_beside_others(task: Task, state: State, k: int) -> State:
    base, fits = _kinds(task, state, k)
    best = max(fits, key=lambda fit: fit.delta_bic)
    behaviour = best.behaviour(base.run)
    if behaviour is None or best.delta_bic < state.added[k].fit.delta_bic + task.options.margin:
        return state
    other = AddedEffect(best, behaviour, ())
    added = (*state.added[:k], other, *state.added[k + 1 :])
    refitted = refit_together(state.bare, task.runs, added)
    now = whole(state.bare, task.runs, state.added)
    if whole(state.bare, task.runs, refitted).score > now.score - task.options.margin:
        return state
    return state.with_added(task.runs, refitted)


def _kinds(task: Task, state: State, k: int) -> tuple[Baseline, list[CandidateFit]]:
    """Return all frictions of the k-th effect's valve fitted behind all other effects.

    The one that is in the model is looked for about its figures too: a search of everything may
    miss what is known.
    """
    base, own = state.beside(task.runs, k), state.added[k]
    fits = []
    for candidate in all_candidates(base):
        if candidate.place != own.place or candidate.about.family != FRICTION:
            continue
        found = fit_candidate(base, base.run.gap, candidate)
        if candidate.identity == own.fit.candidate.identity:
            near = fit_candidate(base, base.run.gap, candidate, own.fit.point)
            found = max(near, found, key=lambda fit: fit.delta_bic)
        fits.append(found)
    return base, fits


def _told(task: Task, state: State, k: int) -> AddedEffect:
    """Return the k-th effect as the better of stiction and backlash behind all others."""
    base, fits = _kinds(task, state, k)
    ranked = sorted(fits, key=lambda fit: -fit.evidence)
    best, doubts = friction_kind(ranked[0], ranked, rests_left(base.run))
    behaviour = best.behaviour(base.run)
    assert behaviour is not None
    return AddedEffect(best, behaviour, doubts)
