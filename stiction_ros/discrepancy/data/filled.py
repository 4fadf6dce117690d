"""Values of PV that a historian filled in between those that it kept."""

import numpy as np

from stiction_ros.discrepancy.measures import SLIGHT
from stiction_ros.effects.behaviour import BoolArray, FloatArray

FLOAT = 2.0 * float(np.finfo(np.float32).eps)  # of the largest value: digits of a difference
NEARLY = 5.0  # digits: noise is as often nearly nothing as that is wider than nothing


def held(values: FloatArray, quantum: float, usable: BoolArray) -> BoolArray:
    """Return which values are exactly those before them, shape (N,): reported by exception.

    None where that is as rare as chance has it. Values that are frozen or clipped are not asked.

    Args:
        values: of one record, shape (N,).
        quantum: their distance; 0 where there is none.
        usable: which are measurements, shape (N,).
    """
    found = np.zeros(len(values), dtype=bool)
    asked = usable[1:] & usable[:-1]
    found[1:][asked] = _too_often(np.abs(np.diff(values))[asked], 0.5 * quantum, values)
    return found


def drawn(values: FloatArray, quantum: float) -> BoolArray:
    """Return which values lie on the straight line of their neighbours, shape (N,).

    None where that is as rare as chance has it.

    Args:
        values: of one record, shape (N,).
        quantum: their distance; 0 where there is none.
    """
    found = np.zeros(len(values), dtype=bool)
    bends, moved = np.abs(np.diff(values, 2)), np.abs(np.diff(values))[1:] > 0.0
    found[1:-1] = _too_often(np.where(moved, bends, np.inf), 2.0 * quantum, values)
    return found


def _too_often(sizes: FloatArray, digits: float, values: FloatArray) -> BoolArray:
    """Return which sizes of differences are nothing, as far as digits of the values tell.

    None where they are not so more often than they are small, as noise would spread them.
    """
    digits = max(digits, FLOAT * float(np.abs(values).max()))
    nothing, small = sizes <= digits, sizes <= NEARLY * digits
    none = np.zeros_like(nothing)
    share = float(np.mean(nothing)) if len(sizes) else 0.0
    if share <= SLIGHT or share <= float(np.mean(small)) - share:
        return none
    others = sizes[~nothing & np.isfinite(sizes)]
    if not len(others) or float(np.median(others)) <= NEARLY * digits:
        return none
    return np.asarray(nothing)
