"""After the looks: whole explanations compared, and each effect told again beside the others."""

import dataclasses

from stiction_ros.discrepancy.decision.decide import (
    FRICTION,
    GapVerdict,
    confirmed,
    large_enough,
    not_contradicted,
)
from stiction_ros.discrepancy.decision.explanation import AddedEffect
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.measures import MARGIN, SURE, TRIED
from stiction_ros.discrepancy.steps.look import look_on, scored_by
from stiction_ros.discrepancy.steps.state import State, Task
from stiction_ros.discrepancy.steps.wholes import best_whole, mended
from stiction_ros.effects import about

Keys = tuple[tuple[str, str], ...]  # places and effects


def settle(task: Task, state: State) -> State:
    """Keep the best whole explanation, the given process mended where that explains more."""
    state = best_of_wholes(task, state)
    other = mended(task, state)
    if other is not None:
        looked = best_of_wholes(task, look_on(task, other))
        last, gained = looked.looks[-1], state.now.score - looked.now.score
        left = max(fit.evidence for fit in last.scores.fits)
        # what leaves more without a name than it explains is not known to be another process
        unnamed = last.decision.verdict is GapVerdict.UNKNOWN and gained <= left
        state = dataclasses.replace(looked, now=state.now) if unnamed else looked
    return told_again(task, state) if len(state.now.effects) > 1 else state


def best_of_wholes(task: Task, state: State) -> State:
    """Keep the best whole explanation: what was found, or a part of it."""
    return dataclasses.replace(state, now=best_whole(state.now, task.options.margin))


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
    fits, twins, rivals = _rivals(task, state, k)
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
    told = dataclasses.replace(kept.effects[k], alternatives=alternatives, fits=tuple(fits))
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


def _rivals(
    task: Task, state: State, k: int
) -> tuple[list[CandidateFit], Keys, list[CandidateFit]]:
    """Return all fits in an effect's place, its twins, and what explains nearly as much.

    All are asked beside the others as they are.
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
        and f.evidence > max(mine - MARGIN - SURE, 0.0)
        and confirmed(f)
        and large_enough(f)
        and not others.now.tells(f)
        and not (own.about.family == f.candidate.about.family == FRICTION)
    ]
    return fits, twins, alike[:TRIED]
