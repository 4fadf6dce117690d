"""After the looks: whole explanations compared, few effects before many."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence

from stiction_ros.discrepancy.candidate.base import figures_of
from stiction_ros.discrepancy.decision.decide import FRICTION, confirmed
from stiction_ros.discrepancy.decision.extend import AddedEffect, refit_together
from stiction_ros.discrepancy.steps.look import look_on
from stiction_ros.discrepancy.steps.mending import mended, singles
from stiction_ros.discrepancy.steps.state import State, Task
from stiction_ros.discrepancy.steps.wholes import best_whole
from stiction_ros.effects import Backlash, about

APART = 5.0  # samples between a step and its opposite that are outliers together
CANCEL = 0.25  # of the larger one, that such two may leave
UNTOLD = 0.15  # of the band of a friction, by which a stem rests elsewhere than its law says


def without_outliers(effects: Sequence[AddedEffect], sample_time: float) -> tuple[AddedEffect, ...]:
    """Return effects without steps that another one takes back.

    A few samples later, both are rows that stand apart from all others. Beside a friction, both
    no larger than its band, they are a stem that slipped elsewhere, or not at all, and slipped
    again; one that is a small part of its band is what no law tells of where a stem rests.

    Args:
        effects: those of an explanation.
        sample_time: of the records, s.
    """
    steps = [each for each in effects if each.fit.candidate.dated and len(each.fit.factors) == 1]
    bands = {each.place: band_of(each) for each in effects if about(each.effect).family == FRICTION}
    gone = [step for step in steps if _size(step) <= UNTOLD * _band(step, bands)]
    for one, other in itertools.combinations(steps, 2):
        if one.fit.candidate.key != other.fit.candidate.key or _is_in(one, gone):
            continue
        apart = abs(float(one.fit.point[0] - other.fit.point[0]))
        total = float(one.fit.factors[0] + other.fit.factors[0])
        largest = max(_size(one), _size(other))
        near = apart <= APART * sample_time or largest <= _band(one, bands)
        if near and not _is_in(other, gone) and abs(total) <= CANCEL * largest:
            gone += [one, other]
    return tuple(each for each in effects if not _is_in(each, gone))


def band_of(friction: AddedEffect) -> float:
    """Return how far apart a stem may rest under the same OP, %."""
    figures = figures_of(friction.behaviour)
    if friction.effect == Backlash.effect:
        return figures["band"]
    return figures["f_s"] + figures["f_d"]


def _size(step: AddedEffect) -> float:
    return abs(float(step.fit.factors[0]))


def _band(step: AddedEffect, bands: Mapping[str, float]) -> float:
    """Return the band of the friction of the valve at which a load steps; 0 where there is none."""
    return bands.get(step.place.replace("load:", "valve:"), 0.0)


def _is_in(effect: AddedEffect, others: Sequence[AddedEffect]) -> bool:
    return any(effect is each for each in others)


def settle(task: Task, state: State) -> State:
    """Keep the best whole explanation, the given process mended where that explains more."""
    state = best_of_wholes(task, state)
    other = mended(task, state)
    return state if other is None else best_of_wholes(task, look_on(task, other))


def best_of_wholes(task: Task, state: State) -> State:
    """Keep the best whole explanation: a part of what was found, or one effect alone."""
    alone = [each for each in singles(state) if confirmed(each.fit)]
    best = best_whole(state.bare, task.runs, state.added, alone, task.options.margin)
    state = dataclasses.replace(state, added=best.effects, base=best.base)
    kept = without_outliers(state.added, task.runs.sample_time)
    if len(kept) == len(state.added):
        return state
    return state.with_added(task.runs, refit_together(state.bare, task.runs, kept))
