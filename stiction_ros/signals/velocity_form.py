"""The velocity form of a controller: what moves of OP are made of."""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray


def terms(error: FloatArray, span: int = 1) -> FloatArray:
    """Return e_k − e_{k−h} and the sum of the h errors up to e_k, shape (N − h, 2).

    Args:
        error: e, or PV where the set-point rests, shape (N,).
        span: h, samples.
    """
    sums = np.cumsum(error)
    return np.column_stack([error[span:] - error[:-span], sums[span:] - sums[:-span]])


def explained(op: FloatArray, pvs: FloatArray, span: int = 1) -> float:
    """Return R² of the moves of OP over ``span`` samples by a PI law of PVs; 0 where it rests.

    Near 1 the set-points hardly moved.

    Args:
        op: shape (N,).
        pvs: shape (N, p).
        span: h, samples.
    """
    moves = op[span:] - op[:-span]
    columns = np.column_stack([*(terms(pv, span) for pv in pvs.T), np.ones(len(moves))])
    spread = float(((moves - moves.mean()) ** 2).sum())
    left = moves - columns @ np.linalg.lstsq(columns, moves, rcond=None)[0]
    return 1.0 - float((left**2).sum()) / spread if spread > 0.0 else 0.0
