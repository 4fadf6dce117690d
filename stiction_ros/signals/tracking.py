"""Which of two columns follows the set-point, and whether OP moves as a PI law of PV says."""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray

CLOSER = 0.1  # distance of a column from SP over that of another from which it is the nearer one
FEWEST = 50  # samples from which a swap of OP and PV is told
OFFSET = 0.3  # lasting offset, as a share of the standard deviation of the error
TRACKED = 0.7  # error, as a share of the standard deviation of a moving SP


def is_nearer(sp: FloatArray, one: FloatArray, other: FloatArray) -> bool:
    """Return whether ``one`` tracks SP, and ``other``, which moves, is far from it; (N,) each.

    Of columns that both lie about SP, as those without their means do, the nearer one may be so by
    its unit alone.
    """
    error, away = one - sp, other - sp
    near = _size(error) <= CLOSER * _size(away) and bool(np.ptp(other) > 0.0)
    return near and _tracks(error, sp) and not _tracks(away, sp)


def _tracks(error: FloatArray, sp: FloatArray) -> bool:
    centred = abs(error.mean()) <= OFFSET * error.std()
    return bool(centred or _size(error) <= TRACKED * float(sp.std()))


def _size(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


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
