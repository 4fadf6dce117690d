"""After the looks: whole explanations compared, few effects before many."""

from __future__ import annotations

import dataclasses

from stiction_ros.discrepancy.decision.decide import confirmed
from stiction_ros.discrepancy.decision.extend import refit_together
from stiction_ros.discrepancy.steps.again import told_again
from stiction_ros.discrepancy.steps.friction import friction_beside_others, friction_told_again
from stiction_ros.discrepancy.steps.look import look_on
from stiction_ros.discrepancy.steps.mending import mended, singles
from stiction_ros.discrepancy.steps.outliers import without_outliers
from stiction_ros.discrepancy.steps.state import State, Task
from stiction_ros.discrepancy.steps.wholes import best_whole, suspicious


def settle(task: Task, state: State) -> State:
    """Keep the best whole explanation, the given process mended where that explains more.

    Which friction it is was told beside nothing; where more than the declared noise is left, it is
    told again before any effect is given up.
    """
    if len(state.added) > 1 and suspicious(state.base):
        state = friction_beside_others(task, state)
    state = best_of_wholes(task, state)
    other = mended(task, state)
    if other is not None:
        state = best_of_wholes(task, look_on(task, other))
    if len(state.added) > 1 or state.changes:
        state = friction_told_again(task, state)
    if len(state.added) > 1:
        state = told_again(task, state)
    return state


def best_of_wholes(task: Task, state: State) -> State:
    """Keep the best whole explanation: a part of what was found, or one effect alone."""
    alone = [each for each in singles(state) if confirmed(each.fit)]
    best = best_whole(state.bare, task.runs, state.added, alone, task.options.margin)
    state = dataclasses.replace(state, added=best.effects, base=best.base)
    kept = without_outliers(state.added, task.runs.sample_time)
    if len(kept) == len(state.added):
        return state
    return state.with_added(task.runs, refit_together(state.bare, task.runs, kept))
