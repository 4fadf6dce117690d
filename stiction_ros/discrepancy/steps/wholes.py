"""Whole explanations, compared over the same rows: few effects before many."""

import dataclasses
import itertools
import math
from collections.abc import Sequence

from stiction_ros.discrepancy.decision.decide import on_the_way
from stiction_ros.discrepancy.decision.extend import AddedEffect, base_with, refit_together
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap.measure import spans_steps
from stiction_ros.discrepancy.gap.noise_effects import noise_effects
from stiction_ros.discrepancy.likelihood.declared_noise import declared_noise
from stiction_ros.discrepancy.process.change import ChangedProcess, ProcessChange, changed_process
from stiction_ros.discrepancy.simulation.free_run import Runs
from stiction_ros.loop import LoopModel

INEXACT = 0.01
"""Share of what all effects gain that each has to gain beside the margin: no plant obeys a law to
the letter, and what the law misses weighs the more the more it explains."""
LAWS = 100.0  # BIC that a law of the noise may gain over an autoregression
Keys = tuple[tuple[str, str], ...]
SINGLES = 4  # effects of the first look that are tried alone against several together


@dataclasses.dataclass(frozen=True)
class Whole:
    """One explanation: the effects of a model, and the noise that is left."""

    effects: tuple[AddedEffect, ...]  # fitted together
    base: Baseline  # of the model with them
    score: float  # −2 log likelihood of fitted and held-out rows, and the price of all figures
    laws: Keys = ()  # places and effects by which its larger noise is told, where that is better

    def worth(self, margin: float) -> float:
        """Return what is to be least: an effect more must gain the margin."""
        return self.score + margin * len(self.effects)


def whole(bare: LoopModel, runs: Runs, effects: Sequence[AddedEffect]) -> Whole:
    """Return the explanation by effects with their present figures, in a model without them."""
    base = base_with(bare, runs, effects)
    score = sum(fit.bic(0) + fit.held_minus_two_log for fit in base.noise)
    rows = max(fit.rows for fit in base.noise)
    figures = sum(each.fit.candidate.count(each.fit.point) for each in effects)
    return Whole(tuple(effects), base, score + figures * math.log(max(rows, 2)))


def with_laws(found: Whole) -> Whole:
    """Return the explanation with its larger noise told by a law, where that is better."""
    score, names = found.score, list(found.laws)
    declared = declared_noise(found.base.run.model)
    for i, (fit, own) in enumerate(zip(found.base.noise, declared, strict=True)):
        if own is None or not fit.enlarged or not spans_steps(found.base, i):
            continue
        laws = noise_effects(found.base, i, own)
        if laws and (gained := laws[0].score - fit.bic(0) - fit.held_minus_two_log) < 0.0:
            score += gained
            names.append((laws[0].place, laws[0].behaviour.effect))
    return dataclasses.replace(found, score=score, laws=tuple(names))


def best_whole(
    bare: LoopModel,
    runs: Runs,
    added: Sequence[AddedEffect],
    singles: Sequence[AddedEffect],
    margin: float,
) -> Whole:
    """Return the best of all subsets of what was found, and of single effects in its stead.

    Args:
        bare, runs: the model without any effect, and the records.
        added: what was found, one after the other.
        singles: effects of the first look that may explain alone what took several.
        margin: that every further effect has to gain, beside a share of what all gain.
    """
    tried, price = [whole(bare, runs, added)], margin
    if added:
        tried.append(whole(bare, runs, ()))
    if len(added) > 1:
        price += INEXACT * max(tried[1].score - tried[0].score, 0.0)
        for count in range(1, len(added)):
            for part in itertools.combinations(added, count):
                tried.append(whole(bare, runs, refit_together(bare, runs, part)))
        known = {each.fit.candidate.key for each in added}
        others = [each for each in singles if each.fit.candidate.key not in known][:SINGLES]
        tried += [whole(bare, runs, [alone]) for alone in others]
    least = min(each.worth(price) for each in tried)
    loads = not any(on_the_way(each.place, each.effect) for each in added)
    near = [
        with_laws(each)
        for each in tried
        if each.worth(price) < least + LAWS or (loads and not each.effects)
    ]
    best = min(near, key=lambda each: each.worth(price))
    if not best.effects and best.laws:
        return _as_well_as_noise(best, near, margin)
    if len(best.effects) != 1 or len(added) < 2:
        return best
    close = [
        other.effects[0].fit.candidate.keys
        for other in near
        if len(other.effects) == 1 and other.worth(margin) < best.worth(margin) + margin
    ]
    return dataclasses.replace(best, effects=(_in_doubt(best.effects[0], close),))


def _as_well_as_noise(noise: Whole, near: Sequence[Whole], margin: float) -> Whole:
    """Return one effect, in doubt with a noise that explains as much; the noise where none does.

    A noise bends as it has to; an effect of few figures that leaves no more is not taken back
    for it.
    """
    rivals = [
        each
        for each in near
        if len(each.effects) == 1
        and not any(fit.enlarged for fit in each.base.noise)
        and each.worth(margin) < noise.worth(margin) + margin
    ]
    if not rivals:
        return noise
    best = min(rivals, key=lambda each: each.worth(margin))
    return dataclasses.replace(best, effects=(_in_doubt(best.effects[0], [noise.laws]),))


def _in_doubt(effect: AddedEffect, rivals: Sequence[Keys]) -> AddedEffect:
    """Return an effect with the rivals that explain as much alone."""
    names = [*effect.alternatives, *(name for keys in rivals for name in keys)]
    own = (effect.place, effect.effect)
    others = tuple(name for name in dict.fromkeys(names) if name != own)
    return dataclasses.replace(effect, alternatives=others)


@dataclasses.dataclass(frozen=True)
class Mended:
    """An explanation behind a process that was changed."""

    changed: ChangedProcess  # the process
    whole: Whole  # the effects behind it
    # as of a whole, the changes included: together they have to gain the margin, and each figure
    # has its price
    worth: float


def suspicious(base: Baseline) -> bool:
    """Tell whether an explanation leaves more than the declared noise, or none is declared."""
    return any(
        fit.enlarged or not forms for fit, forms in zip(base.noise, base.declared, strict=True)
    )


def best_with_process(
    bare: LoopModel,
    runs: Runs,
    added: Sequence[AddedEffect],
    singles: Sequence[AddedEffect],
    margin: float,
) -> Mended | None:
    """Return the best explanation with another process and all, one, or none of the effects.

    Args:
        bare, runs: the model without any effect, and the records.
        added: what was found with the process as it is.
        singles: effects that may stand alone beside another process, though none was found.
        margin: that the changes together have to gain.
    """
    parts: list[tuple[AddedEffect, ...]] = [(), *((each,) for each in (*added, *singles))]
    if len(added) > 1:
        parts.append(tuple(added))
    found = [with_process(bare, runs, part, margin) for part in parts]
    return min((each for each in found if each), key=lambda each: each.worth, default=None)


def with_process(
    bare: LoopModel, runs: Runs, part: Sequence[AddedEffect], margin: float
) -> Mended | None:
    """Return the explanation by some effects behind a process that is changed for them.

    It is changed under the declared noise and under the larger one that is found: what is there
    besides may be steps or a walk, and the one or the other shows the process.

    The changes together have to gain the margin.
    """
    grounds = (True, False) if any(declared_noise(bare)) else (False,)
    found = [
        _behind(changed, runs, margin)
        for declared in grounds
        if (changed := changed_process(bare, runs, part, declared)) is not None
    ]
    return min(found, key=lambda each: each.worth, default=None)


def _behind(changed: ChangedProcess, runs: Runs, margin: float) -> Mended:
    """Return the explanation by effects that are fitted again behind a changed process."""
    effects = refit_together(changed.model, runs, changed.effects) if changed.effects else ()
    own = whole(changed.model, runs, effects)
    rows = max(fit.rows for fit in own.base.noise)
    return Mended(changed, own, own.worth(margin) + price_of(changed.changes, rows, margin))


def same_thing(changes: Sequence[ProcessChange], effects: Sequence[str]) -> bool:
    """Tell whether a changed process is one effect of the process by another name.

    A model that is a little off is so in several figures; one alone is what an effect says.
    """
    whats = {change.what for change in changes}
    return len(whats) == 1 and whats <= set(effects)


def price_of(changes: Sequence[ProcessChange], rows: int, margin: float) -> float:
    """Return what changes of the process cost: the margin together, and each its price in BIC."""
    return margin + len(changes) * math.log(max(rows, 2)) if changes else 0.0
