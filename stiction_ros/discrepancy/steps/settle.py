"""After the looks: whole explanations compared, and each effect told again beside the others."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence

from stiction_ros.discrepancy.candidate.base import figures_of
from stiction_ros.discrepancy.decision.decide import (
    FRICTION,
    confirmed,
    large_enough,
    not_contradicted,
)
from stiction_ros.discrepancy.decision.explanation import AddedEffect
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.measures import TRIED
from stiction_ros.discrepancy.steps.look import look_on, scored_by
from stiction_ros.discrepancy.steps.state import State, Task
from stiction_ros.discrepancy.steps.wholes import Keys, best_whole, mended, singles
from stiction_ros.effects import Backlash, about

APART = 5.0  # samples between a step and its opposite that are outliers together
CANCEL = 0.25  # of the larger one, that such two may leave
UNTOLD = 0.15  # of the band of a friction, by which a stem rests elsewhere than its law says
NEAR = 40.0  # evidence, by which a rival may be behind beside figures that were fitted without it


def settle(task: Task, state: State) -> State:
    """Keep the best whole explanation, the given process mended where that explains more."""
    state = best_of_wholes(task, state)
    other = mended(task, state)
    if other is not None:
        state = best_of_wholes(task, look_on(task, other))
    return told_again(task, state) if len(state.now.effects) > 1 else state


def best_of_wholes(task: Task, state: State) -> State:
    """Keep the best whole explanation: a part of what was found, or one effect alone."""
    alone = [each for each in singles(state) if confirmed(each.fit)]
    best = best_whole(state.now, alone, task.options.margin)
    kept = without_outliers(best.effects, task.runs.sample_time)
    if len(kept) < len(best.effects):
        best = best.refitted(kept)
    return dataclasses.replace(state, now=best)


def without_outliers(effects: Sequence[AddedEffect], sample_time: float) -> tuple[AddedEffect, ...]:
    """Return effects without steps that another one takes back.

    Two opposite steps a few samples apart are outliers. Beside a friction, two opposite steps no
    larger than its band are a slip at another place than the law says, and the next slip. A single
    step of a small part of the band is the error of the law in where the stem rests.

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


def told_again(task: Task, state: State) -> State:
    """Tell each of several effects again: its nearest rivals in its place, all fitted together.

    What was told first was told beside something that was not yet in the model, and the figures
    of the others were fitted beside it. The whole that explains most holds; those within the
    margin are in doubt.
    """
    for k in range(len(state.now.effects)):
        state = _told(task, state, k)
    return state


def _told(task: Task, state: State, k: int) -> State:
    own, margin = state.now.effects[k], task.options.margin
    tried = [(own, state.now)]
    twins, rivals = _rivals(task, state, k)
    for rival in rivals:
        other = AddedEffect(rival, rival.candidate.twins)
        added = (*state.now.effects[:k], other, *state.now.effects[k + 1 :])
        tried.append((other, state.now.refitted(added)))
    best, kept = min(tried, key=lambda each: each[1].score)
    near = [
        key
        for each, whole in tried
        if each is not best and whole.score < kept.score + margin
        for key in each.fit.candidate.keys
    ]
    alternatives = tuple(dict.fromkeys([*_inseparable(best, twins), *near]))
    told = dataclasses.replace(kept.effects[k], alternatives=alternatives)
    effects = (*kept.effects[:k], told, *kept.effects[k + 1 :])
    return dataclasses.replace(state, now=dataclasses.replace(kept, effects=effects))


def _inseparable(effect: AddedEffect, twins: Keys) -> list[tuple[str, str]]:
    """Return what no fit tells from an effect: its twins, and the other kind of a friction."""
    friction = about(effect.effect).family == FRICTION
    return [
        key
        for key in effect.alternatives
        if key in (*effect.fit.candidate.twins, *twins)
        or (friction and about(key[1]).family == FRICTION)
    ]


def _rivals(task: Task, state: State, k: int) -> tuple[Keys, list[CandidateFit]]:
    """Return what is an effect's twin, and what explains nearly as much in its place.

    Both are asked beside the others as they are.
    """
    own = state.now.effects[k].fit.candidate
    others = state.holding(state.now.others(k))
    scores = scored_by(task, others, task.options.most_effects)
    fits = not_contradicted(scores.base.run, scores.fits)
    mine = max((f.evidence for f in fits if f.candidate.key == own.key), default=0.0)
    twins = next((f.candidate.twins for f in fits if f.candidate.key == own.key), ())
    known = {own.key, *(each.fit.candidate.key for each in others.now.effects)}
    alike = [
        f
        for f in sorted(fits, key=lambda f: -f.evidence)
        if f.candidate.inside
        and f.candidate.key not in known
        and f.evidence > max(mine - NEAR, 0.0)
        and confirmed(f)
        and large_enough(f)
        and not others.now.tells(f)
        and not (own.about.family == f.candidate.about.family == FRICTION)
    ]
    return twins, alike[:TRIED]
