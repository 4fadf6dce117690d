"""Whole explanations, compared over the same rows: few effects before many, or another process."""

import dataclasses
import itertools
from collections.abc import Sequence

from stiction_ros.discrepancy.decision.decide import large_enough
from stiction_ros.discrepancy.decision.explanation import AddedEffect, Explanation, ProcessChange
from stiction_ros.discrepancy.decision.scores import Scores
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.declared_noise import declared_noise
from stiction_ros.discrepancy.measures import NEGLIGIBLE, TRIED
from stiction_ros.discrepancy.process.change import changed_process
from stiction_ros.discrepancy.simulation.equation import GAIN
from stiction_ros.discrepancy.steps.state import State, Task


def best_whole(now: Explanation, margin: float) -> Explanation:
    """Return the best of all subsets of what was found, one effect after the other.

    Every further effect has to gain the margin, beside a share of what all gain.
    """
    added = now.effects
    if not added:
        return now
    tried, price = [now, now.holding(())], margin
    if len(added) > 1:
        price += share_of_all(now, tried[1])
        for count in range(1, len(added)):
            tried += [now.refitted(part) for part in itertools.combinations(added, count)]
    return min(tried, key=lambda each: each.worth(price))


def share_of_all(whole: Explanation, bare: Explanation) -> float:
    """Return what one more effect has to gain of all that a whole gains over one without effects.

    No plant obeys a law to the letter: what the law misses weighs the more the more it explains.
    """
    return NEGLIGIBLE * max(bare.score - whole.score, 0.0)


def suspicious(base: Baseline) -> bool:
    """Tell whether an explanation leaves more than the declared noise, or none is declared."""
    return any(
        fit.enlarged or not forms for fit, forms in zip(base.noise, base.declared, strict=True)
    )


def with_process(task: Task, state: State, part: Sequence[AddedEffect]) -> Explanation | None:
    """Return the explanation by some effects behind a process that is changed for them.

    It is changed under the declared noise and under the larger one that is found: what is there
    besides may be steps or a walk, and the one or the other shows the process.
    """
    grounds = (True, False) if any(declared_noise(state.given)) else (False,)
    found = [changed_process(state.given, task.runs, part, declared) for declared in grounds]
    return _best(task, found)


def _best(task: Task, found: Sequence[Explanation | None]) -> Explanation | None:
    whole = (each for each in found if each is not None)
    return min(whole, key=lambda each: each.worth(task.options.margin), default=None)


def same_thing(changes: Sequence[ProcessChange], effects: Sequence[str]) -> bool:
    """Tell whether a changed process is one effect of the process by another name.

    A model that is a little off is so in several figures; one alone is what an effect says. Of
    another gain the looks have judged already, beside a curve of the valve. What is too small to
    matter is no effect.
    """
    if not any(change.matters for change in changes):
        return False
    whats = {change.what for change in changes}
    return whats == {GAIN} or (len(whats) == 1 and whats <= set(effects))


def mended(task: Task, state: State) -> State | None:
    """Return the state behind another process, where that, beside fewer effects, explains more.

    A model that was fitted to another record is never exact: what its errors leave looks
    like effects. Effects that have a name give way to another process by the margin only. Where
    none has a name, another process beside an effect has to explain more than the effect that
    explains most alone. Behind the process all effects, one or none of them are tried.
    """
    if not suspicious(state.now.base):
        return None
    margin, added = task.options.margin, state.now.effects
    alone = [] if added else singles(state, margin)[:TRIED]
    parts = [(), *((each,) for each in added or alone)]
    parts += [added] if len(added) > 1 else []
    found = _best(task, [with_process(task, state, part) for part in parts])
    due = margin if added else max((each.fit.evidence - margin for each in alone), default=0.0)
    if found is None or found.worth(margin) >= state.now.worth(margin) - due:
        return None
    names = [each.effect for each in added] or _left_in_doubt(state)
    beside = bool(found.effects) and not added  # no look has judged a gain beside these effects
    matter = any(change.matters for change in found.changes)  # else no name gives way to them
    if not matter or (not beside and same_thing(found.changes, names)):
        return None
    # Where no effect was in the model, the looks have to find it.
    other = found if added else found.holding(())
    return dataclasses.replace(state, now=other)


def process_first(task: Task, state: State, scores: Scores) -> State | None:
    """Return the state behind another process, where no effect of a look explains as much.

    The larger of two is found first, whichever it is: what a model that is off leaves
    behind every move looks like steps.
    """
    margin = task.options.margin
    slower = any(fit.evidence >= margin for fit in scores.fits if fit.candidate.absorbed)
    if task.options.process_fitted or state.now.changes:
        return None
    if not (slower or suspicious(state.now.base)):
        return None
    found = with_process(task, state, state.now.effects)
    if found is None:
        return None
    named = [fit for fit in scores.fits if fit.candidate.inside and large_enough(fit)]
    gained = max([0.0, *(fit.evidence for fit in named)])
    explained = state.now.worth(margin) - found.worth(margin)
    if state.now.effects:  # as of each further effect
        explained -= share_of_all(state.now, state.now.holding(()))
    near = min(gained, explained - margin)
    rivals = [fit.candidate.effect for fit in named if fit.evidence >= max(near, 0.0)]
    if explained <= gained or same_thing(found.changes, rivals):
        return None
    return dataclasses.replace(state, now=found)


def changed_again(task: Task, state: State, effects: Sequence[AddedEffect]) -> Explanation | None:
    """Return the explanation by effects behind a process that is changed for them once more.

    None where the process was not changed before, or is better as it is.
    """
    if not state.now.changes:
        return None
    margin, found = task.options.margin, with_process(task, state, effects)
    better = found is not None and found.worth(margin) < state.now.holding(effects).worth(margin)
    return found if better else None


def singles(state: State, margin: float) -> list[AddedEffect]:
    """Return the effects that explained more than the margin alone in the first look, in order."""
    return [
        AddedEffect(fit, fit.candidate.twins)
        for fit in sorted(state.looks[0].scores.fits, key=lambda fit: -fit.evidence)
        if fit.candidate.inside and fit.evidence >= margin and large_enough(fit)
    ]


def _left_in_doubt(state: State) -> list[str]:
    """Return the effects of the set that the last look left in doubt; none where it left none.

    Where another figure of the process is in the set, the others explain as much: it is no
    correction of the model.
    """
    last = state.looks[-1].decision
    if last.chosen is None:
        return []
    return [last.chosen.candidate.effect, *(effect for _, effect in last.alternatives)]
