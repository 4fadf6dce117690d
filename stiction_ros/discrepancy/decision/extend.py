"""Step 7: an effect becomes a block of the loop model, or is rolled back."""

import math
from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.decision.decide import FRICTION, borne_out
from stiction_ros.discrepancy.decision.explanation import AddedEffect, Explanation, refit_together
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.measures import MARGIN
from stiction_ros.effects import FloatArray
from stiction_ros.signals.holds import stretches

GROWN = 2.0  # standard errors by which the free-run error of the held-out blocks may grow


def extend(
    process: Explanation, effects: Sequence[AddedEffect], before: Baseline, *, lent: bool = False
) -> tuple[Explanation | None, str]:
    """Fit effects together, the last of them a new one, and see whether the gap has shrunk.

    Args:
        process: as it is taken, whatever effects it holds.
        effects: those of earlier looks, and the new one.
        before: of the model without the new one.
        lent: whether it is added for a while, though the held-out rows refuse it.

    Returns:
        The explanation with them; None where the new one does not stay, and why.
    """
    *others, new = refit_together(process.bare, process.runs, effects)
    worth = [each for each in others if each.fit.delta_bic >= MARGIN]
    grown = process.holding([*worth, new])
    if not (lent or held_rows_bear_out(before, grown.base, dated=new.fit.candidate.dated)):
        return None, "the innovations of the held-out rows do not become smaller"
    return grown, ""


def told_already(added: Sequence[AddedEffect], fit: CandidateFit) -> bool:
    """Tell whether a fit is one more friction or curve of a valve that has one already.

    Laws tell one thing in several ways: the second one mends the figures of the first.
    """
    new = fit.candidate
    return any(
        each.place == new.place
        and (
            (new.curved and each.fit.candidate.curved)
            or each.fit.candidate.about.family == FRICTION == new.about.family
        )
        for each in added
    )


def held_rows_bear_out(base: Baseline, after_base: Baseline, *, dated: bool) -> bool:
    """Tell whether the held-out rows bear out what lies between two models."""
    return borne_out(base.bic - after_base.bic, after_base.held_gain(base), dated)


def moved_away(base: Baseline, after_base: Baseline) -> bool:
    """Tell whether the squared error of the free run has grown by more than chance.

    Held-out blocks are independent witnesses: their growths, weighed by the innovations, have
    a mean and a standard error.
    """
    growths: list[FloatArray] = []
    for old, new, blocks in zip(base.noise, after_base.noise, base.blocks, strict=True):
        unit = max(old.innovation_std, 1e-300)
        growth = np.where(blocks.held, (new.residual / unit) ** 2 - (old.residual / unit) ** 2, 0.0)
        begins, _ = stretches(blocks.held)
        if len(begins):
            growths.append(np.add.reduceat(growth, begins))
    if not growths:
        return False
    blocks_of_one = min(len(each) for each in growths)
    total = np.sum([each[:blocks_of_one] for each in growths], axis=0)
    if blocks_of_one < 3:
        return float(total.sum()) > 0.0
    return float(total.mean()) > GROWN * float(total.std(ddof=1)) / math.sqrt(blocks_of_one)
