"""Outputs of a state-space model, computed from its inputs and its initial state."""

from collections.abc import Iterable

import numpy as np

from stiction_ros.effects.behaviour import FloatArray


def responses(
    a: FloatArray, c: FloatArray, drives: Iterable[FloatArray], start: FloatArray | float = 0.0
) -> FloatArray:
    """Return C x_k for x_{k+1} = A x_k + drives_k, several side by side, shape (N, p, q).

    Args:
        a: shape (n, n).
        c: shape (p, n).
        drives: N of them, shape (n, q) each.
        start: x_0, shape (n, q), or 0.
    """
    state, out = start, []
    for drive in drives:
        now = np.broadcast_to(state, drive.shape)
        out.append(c @ now)
        state = a @ now + drive
    return np.array(out)
