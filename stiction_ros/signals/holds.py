"""Stretches of samples: where something is so without a break, and where a set-point rests."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import BoolArray, FloatArray


def stretches(
    there: BoolArray, cuts: Sequence[int] = ()
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return where stretches of True begin, and the places behind their ends, shape (R,) each.

    Args:
        there: shape (N,).
        cuts: places before which a stretch ends, 0 to N.

    Examples:
        >>> import numpy as np
        >>> from stiction_ros.signals.holds import stretches
        >>> begins, ends = stretches(np.array([True, True, False, True]), [1])
        >>> print(begins, ends)
        [0 1 3] [1 2 4]
    """
    cut = np.zeros(len(there) + 1, dtype=bool)
    cut[list(cuts)] = True
    before, after = np.append(False, there), np.append(there, False)
    return np.flatnonzero(after & (~before | cut)), np.flatnonzero(before & (~after | cut))


def set_point_moves(sp: FloatArray) -> NDArray[np.intp]:
    """Return the samples at which a set-point differs from the sample before, ascending.

    Args:
        sp: set-points, shape (N, p).
    """
    return np.flatnonzero(np.any(np.diff(sp, axis=0) != 0.0, axis=1)) + 1


def holds(sp: FloatArray) -> list[tuple[int, int]]:
    """Return first and one-past-last sample of every stretch without a set-point move.

    Args:
        sp: set-points, shape (N, p).
    """
    edges = [0, *set_point_moves(sp).tolist(), len(sp)]
    return [(a, b) for a, b in itertools.pairwise(edges) if b > a]
