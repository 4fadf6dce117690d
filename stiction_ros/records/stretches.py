"""Rows that follow each other and are all alike."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import IntArray


def stretches(there: NDArray[np.bool_]) -> tuple[IntArray, IntArray]:
    """Return where stretches of True begin, and the places behind their ends, shape (R,) each.

    Args:
        there: shape (N,).

    Examples:
        >>> import numpy as np
        >>> from stiction_ros.records.stretches import stretches
        >>> begins, ends = stretches(np.array([True, True, False, True]))
        >>> print(begins, ends)
        [0 3] [2 4]
    """
    edges = np.diff(np.concatenate([[0], there.astype(np.int8), [0]]))
    return np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
