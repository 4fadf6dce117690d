"""A gain beside the curve of a valve: laws of a curve differ in slope where they bend alike."""

from __future__ import annotations

from stiction_ros.discrepancy.steps.mending import behind
from stiction_ros.discrepancy.steps.state import State, Task
from stiction_ros.discrepancy.steps.wholes import whole, with_process
from stiction_ros.effects import ProcessGain


def slope_to_its_curve(task: Task, state: State) -> State:
    """Return the state without a gain that is the slope of a valve's curve.

    A record shows a curve along the OP that it visits: how it bends there, and how steep it is.
    The law by which the one goes with the other is a guess; a gain that stands beside the curve
    mends that guess. It belongs to the model, as far as a model's gain may be off, and is no
    effect of its own.
    """
    if len(state.bare.valves) != 1 or len(state.bare.outputs) != 1:
        return state
    others = [each for each in state.added if each.effect != ProcessGain.effect]
    curved = any(each.fit.candidate.curved for each in others)
    if not curved or len(others) == len(state.added):
        return state
    margin, now = task.options.margin, whole(state.bare, task.runs, state.added)
    found = with_process(state.given, task.runs, others, margin)
    if found is None or found.whole.score > now.score + margin:
        return state
    return behind(state, found)
