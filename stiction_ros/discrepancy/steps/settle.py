"""After the looks: whole explanations compared, few effects before many."""

from __future__ import annotations

import dataclasses

from stiction_ros.discrepancy.decision.decide import confirmed
from stiction_ros.discrepancy.steps.look import look_on
from stiction_ros.discrepancy.steps.mending import mended, singles
from stiction_ros.discrepancy.steps.state import State, Task
from stiction_ros.discrepancy.steps.wholes import best_whole


def settle(task: Task, state: State) -> State:
    """Keep the best whole explanation, the given process mended where that explains more."""
    state = best_of_wholes(task, state)
    other = mended(task, state)
    return state if other is None else best_of_wholes(task, look_on(task, other))


def best_of_wholes(task: Task, state: State) -> State:
    """Keep the best whole explanation: a part of what was found, or one effect alone."""
    alone = [each for each in singles(state) if confirmed(each.fit)]
    best = best_whole(state.bare, task.runs, state.added, alone, task.options.margin)
    return dataclasses.replace(state, added=best.effects, base=best.base)
