"""What is left in doubt in words is left in doubt in figures, too."""

from __future__ import annotations

from stiction_ros.discrepancy.answer.found_effects import SIZES
from stiction_ros.discrepancy.candidate.base import figures_of
from stiction_ros.discrepancy.decision.extend import AddedEffect
from stiction_ros.discrepancy.fit.uncertainty import Intervals
from stiction_ros.effects import Backlash, HeStiction


def without_its_jump(intervals: Intervals, effect: AddedEffect) -> Intervals:
    """Return the intervals of a stiction, wide enough for no jump where that is not told from one.

    Backlash is stiction whose f_S and f_D are both half of the band.
    """
    backlash = effect.place, Backlash.effect
    if effect.effect != HeStiction.effect or backlash not in effect.alternatives:
        return intervals
    static, dynamic = intervals["f_s"], intervals["f_d"]
    figures = figures_of(effect.behaviour)
    half = 0.5 * (figures["f_s"] + figures["f_d"])
    return {
        **intervals,
        "f_s": (min(static[0], half), static[1]),
        "f_d": (dynamic[0], max(dynamic[1], half)),
    }


def behind_slope(intervals: Intervals, slope: float) -> Intervals:
    """Return the intervals of a load, wide enough for either side of a curve's own slope.

    A gain beside the curve of a valve mends the law by which its slope goes with its bend. What
    enters beside the stem does not pass the curve: whether it passes that gain is not told.

    Args:
        intervals: behind the gain.
        slope: the gain, 1 where none was changed.
    """
    found = dict(intervals)
    for key in SIZES:
        if key in found:
            low, high = found[key]
            found[key] = (min(low, slope * low), max(high, slope * high))
    return found
