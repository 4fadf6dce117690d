"""The process as it was given, changed where that explains more than effects do."""

import dataclasses
from collections.abc import Sequence

from stiction_ros.discrepancy.decision.decide import large_enough
from stiction_ros.discrepancy.decision.extend import AddedEffect
from stiction_ros.discrepancy.decision.scores import Scores
from stiction_ros.discrepancy.steps.state import State, Task
from stiction_ros.discrepancy.steps.wholes import (
    Mended,
    Whole,
    best_with_process,
    price_of,
    same_thing,
    suspicious,
    whole,
    with_process,
)

BEHIND = 3  # effects that are tried behind another process where none was found


def mended(task: Task, state: State) -> State | None:
    """Return the state behind another process, where that, beside fewer effects, explains more.

    A model that was fitted to another record is never exact: what its errors leave looks
    like effects. Effects that have a name give way to it by the margin only.
    """
    if not suspicious(state.base):
        return None
    margin = task.options.margin
    now = whole(state.bare, task.runs, state.added)
    rest = [] if state.added else singles(state)[:BEHIND]
    found = best_with_process(state.given, task.runs, state.added, rest, margin)
    due = margin if state.added else 0.0
    if found is None or found.worth >= now.worth(margin) + _price(task, state, now) - due:
        return None
    names = [each.effect for each in state.added] or _left_in_doubt(state)
    if same_thing(found.changed.changes, names):
        return None
    other = dataclasses.replace(
        state,
        bare=found.changed.model,
        changes=found.changed.changes,
        slopes=found.changed.slopes,
        earlier=(),
        opened=len(state.looks),
    )
    # Where no effect was in the model, the looks have to find it.
    return other.with_added(task.runs, found.whole.effects if state.added else ())


def process_first(task: Task, state: State, scores: Scores) -> State | None:
    """Return the state behind another process, where no effect of a look explains as much.

    The larger of two is found first, whichever it is: what a model that is off leaves
    behind every move looks like steps.
    """
    margin = task.options.margin
    slower = any(fit.evidence >= margin for fit in scores.fits if fit.candidate.absorbed)
    if task.options.process_fitted or state.changes or not (slower or suspicious(state.base)):
        return None
    now = whole(state.bare, task.runs, state.added)
    found = with_process(state.given, task.runs, state.added, margin)
    inside = [fit for fit in scores.fits if fit.candidate.inside and fit.evidence > 0.0]
    best = max(inside, key=lambda fit: fit.evidence, default=None)
    gained = 0.0 if best is None else best.evidence
    if found is None or found.worth >= now.worth(margin) - gained:
        return None
    explained = now.worth(margin) - found.worth  # one figure alone is what an effect says
    rivals = [fit.candidate.effect for fit in inside if fit.evidence > explained - margin]
    if best is not None and same_thing(found.changed.changes, [best.candidate.effect, *rivals]):
        return None
    return behind(state, found)


def changed_again(task: Task, state: State) -> State:
    """Fit the changes of the process again, if there are any, beside what was found since."""
    found = _fitted_again(task, state, state.added)
    return state if found is None else behind(state, found)


def made_room(task: Task, state: State, new: AddedEffect) -> tuple[State, AddedEffect]:
    """Return the state without a new effect, and the effect; its process changed beside both."""
    found = _fitted_again(task, state, (*state.added, new))
    if found is None:
        return state, new
    *others, last = found.whole.effects
    return dataclasses.replace(behind(state, found), added=tuple(others), base=state.base), last


def _fitted_again(task: Task, state: State, effects: Sequence[AddedEffect]) -> Mended | None:
    """Return the explanation by effects behind a process that is changed for them.

    None where the process was not changed before, or is better as it is.
    """
    if not state.changes:
        return None
    margin = task.options.margin
    now = whole(state.bare, task.runs, effects)
    found = with_process(state.given, task.runs, effects, margin)
    better = found is not None and found.worth < now.worth(margin) + _price(task, state, now)
    return found if better else None


def singles(state: State) -> list[AddedEffect]:
    """Return the effects that explain most alone, the process as it is now."""
    look = state.looks[min(state.opened, len(state.looks) - 1)]
    found = []
    for fit in sorted(look.scores.fits, key=lambda fit: -fit.evidence):
        behaviour = fit.behaviour(look.scores.base.run)
        if behaviour is not None and fit.evidence > 0.0 and large_enough(fit):
            found.append(AddedEffect(fit, behaviour, fit.candidate.twins))
    return found


def behind(state: State, found: Mended) -> State:
    """Return the state with a changed process, and what it has of effects refitted behind it."""
    return dataclasses.replace(
        state,
        bare=found.changed.model,
        changes=found.changed.changes,
        slopes=found.changed.slopes,
        added=found.whole.effects,
        base=found.whole.base,
        earlier=(),
    )


def _left_in_doubt(state: State) -> list[str]:
    """Return the effects of the set that the last look left in doubt; none where it left none.

    Where another figure of the process is in the set, the others explain as much: it is no
    correction of the model.
    """
    last = state.looks[-1].decision
    if last.chosen is None:
        return []
    return [last.chosen.candidate.effect, *(effect for _, effect in last.alternatives)]


def _price(task: Task, state: State, now: Whole) -> float:
    """Return what the changes of the process cost an explanation."""
    rows = max(fit.rows for fit in now.base.noise)
    return price_of(state.changes, rows, task.options.margin)
