r"""An OP that was recorded coarsely, told finer by the controller's own law.

Each recorded OP lies within half a step of its value, and a PI law gives its next move from SP and
PV. What both allow is an interval that moves on with the law and is cut by every recorded value,
forwards and backwards; where it is cut to nothing, the law was not at work, as at a limit or in
manual, and the recorded value alone counts:

.. math::
    U_k = [u_k - q/2, u_k + q/2] \cap
    (U_{k-1} + K [(e_k - e_{k-1}) + (T_s / T_i) e_k] \pm \epsilon)
"""

from __future__ import annotations

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects import FloatArray

FINER = 0.25  # of the step of the recorded values, that is left at most on average


def unrounded(
    op: FloatArray,
    moves: FloatArray,
    slack: float,
    quantum: float,
    limits: tuple[float, float],
) -> FloatArray | None:
    """Return the OP that a law gives within the steps of the recorded one, shape (N,).

    None where the law does not tell it much finer.

    Args:
        op: as recorded, %, shape (N,).
        moves: that the law gives from each sample to the next, %, shape (N − 1,).
        slack: by how much a move may be another, %.
        quantum: distance of the recorded values, %.
        limits: at which OP is what it is recorded to be.
    """
    low, high = _steps(op, quantum, limits)
    _follow(low, high, moves, slack)
    if float(np.mean(high - low)) > FINER * quantum:
        return None
    return np.asarray(0.5 * (low + high))


def left_out(
    op: FloatArray,
    moves: FloatArray,
    slack: float,
    quantum: float,
    limits: tuple[float, float],
) -> int:
    """Return at how many samples no OP within its step follows a law; as :func:`unrounded`."""
    low, high = _steps(op, quantum, limits)
    return int(_follow(low, high, moves, slack))


def _steps(
    op: FloatArray, quantum: float, limits: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    half = np.where((op <= limits[0]) | (op >= limits[1]), 0.0, 0.5 * quantum)
    return op - half, op + half


@compiled
def _follow(low: FloatArray, high: FloatArray, moves: FloatArray, slack: float) -> int:
    """Cut intervals to what a law allows, in place; return how many it cuts to nothing."""
    joined = np.zeros(len(low), dtype=np.bool_)  # whether the law has led from the sample before
    for k in range(1, len(low)):
        least = max(low[k], low[k - 1] + moves[k - 1] - slack)
        most = min(high[k], high[k - 1] + moves[k - 1] + slack)
        if least <= most:
            low[k], high[k], joined[k] = least, most, True
    for k in range(len(low) - 1, 0, -1):
        if joined[k]:
            low[k - 1] = max(low[k - 1], low[k] - moves[k - 1] - slack)
            high[k - 1] = min(high[k - 1], high[k] - moves[k - 1] + slack)
    return int(len(low) - 1 - np.sum(joined))
