"""Rectangles of the (J, S) plane: rows (J low, J high, S low, S high), %, shape (R, 4)."""

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray


def area(rectangles: FloatArray) -> float:
    """Return the area of all rectangles."""
    jl, jh, sl, sh = rectangles.T
    return float((jh - jl) @ (sh - sl))


def points_inside(rectangles: FloatArray) -> FloatArray:
    """Return one point (J, S) with S ≥ J inside every rectangle, the middle where possible."""
    jl, jh, sl, sh = rectangles.T
    jump, reverse = 0.5 * (jl + jh), 0.5 * (sl + sh)
    outside = reverse < jump
    jump = np.where(outside, jl + 0.1 * (np.minimum(jh, sh) - jl), jump)
    reverse = np.where(outside, sh - 0.1 * (sh - np.maximum(sl, jl)), reverse)
    return np.column_stack([jump, reverse])


def remainders(rectangles: FloatArray, cells: FloatArray) -> FloatArray:
    """Return up to four rectangles per row: what its cell does not cover."""
    jl, jh, sl, sh = rectangles.T
    cl, ch = np.maximum(cells[:, 0], jl), np.minimum(cells[:, 1], jh)
    dl, dh = np.maximum(cells[:, 2], sl), np.minimum(cells[:, 3], sh)
    return np.concatenate(
        [
            np.column_stack([jl, cl, sl, sh]),
            np.column_stack([ch, jh, sl, sh]),
            np.column_stack([cl, ch, sl, dl]),
            np.column_stack([cl, ch, dh, sh]),
        ]
    )


def overlapping(rectangles: FloatArray, other: FloatArray) -> NDArray[np.bool_]:
    """Return which rectangles share more than an edge with another one, shape (R,)."""
    jl, jh, sl, sh = rectangles.T
    meets = (jl < other[1]) & (jh > other[0]) & (sl < other[3]) & (sh > other[2])
    return np.asarray(meets)
