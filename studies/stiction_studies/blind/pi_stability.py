"""How near PI controllers are to the limit of stability."""

import numpy as np

from stiction_ros.effects import FloatArray
from stiction_ros.processes import LinearModel

_GROWTH = 1.3
_HALVINGS = 40


def closed_loop_radius(linear: LinearModel, gains: FloatArray, integral_times: FloatArray) -> float:
    """Return the largest modulus of the poles under one PI controller per valve and output.

    The state of a PI controller is its integral: OP = −K (y + (Σ y)/T_i), the sum with the
    present y. Controller i takes output i and moves valve i.

    Args:
        linear: the process; its first m valves and outputs are taken.
        gains: K in % per unit of PV, signed, shape (m,).
        integral_times: T_i in samples, shape (m,).
    """
    n, m = linear.order, len(gains)
    a, b, c = linear.a, linear.b[:, :m], linear.c[:m]
    shares = 1.0 / integral_times
    closed = np.eye(n + m)
    closed[:n, :n] = a - (b * (gains * (1.0 + shares))) @ c
    closed[:n, n:] = -b * (gains * shares)
    closed[n:, :n] = c
    return float(np.abs(np.linalg.eigvals(closed)).max())


def largest_gains(
    linear: LinearModel, integral_times: FloatArray, radius: float, first: FloatArray
) -> FloatArray:
    """Return the largest multiple of gains whose closed-loop poles stay within ``radius``.

    Args:
        linear: the process; its first m valves and outputs are taken.
        integral_times: T_i in samples, shape (m,).
        radius: of a circle about zero, at most 1.
        first: gains at which the loop is stable, shape (m,).
    """
    factor = 1.0
    while closed_loop_radius(linear, factor * first, integral_times) < 1.0:
        factor *= _GROWTH
    low, high = 0.5 * factor, factor
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if closed_loop_radius(linear, middle * first, integral_times) < radius:
            low = middle
        else:
            high = middle
    return low * first
