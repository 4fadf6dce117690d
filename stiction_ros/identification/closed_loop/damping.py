"""How a loop without friction rings: the poles of controller and process together."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.closed_loop.loop_run import Process


@dataclasses.dataclass(frozen=True)
class Ringing:
    """One oscillation of a linear loop.

    Attributes:
        period: samples.
        growth: share of an oscillation that is left after one period; 1 and more is sustained.
    """

    period: float
    growth: float


@dataclasses.dataclass(frozen=True)
class LinearController:
    """One controller as :mod:`.loop_run` simulates it.

    Attributes:
        tuning: (K, K_i, K_d), shape (3,).
        lag: samples between PV and OP.
        smoothing: share of the last value in the filter of the error.
    """

    tuning: FloatArray
    lag: int
    smoothing: float


def ringing(
    process: Process, output: int, valve: int, controller: LinearController
) -> tuple[Ringing, ...]:
    r"""Return the oscillations of one valve and one output, the least damped first.

    The roots of

    .. math:: A(q)(1 - q)(1 - s q) + (1 - s) C(q) B(q) q^{1 + t_d + lag}, \quad
              C = K (1 - q) + K_i + K_d (1 - q)^2

    in the backward shift q, over which the loop is closed, are the inverse poles. One on the
    negative axis rings from sample to sample, with a period of two.
    """
    gain, reset, rate = (float(value) for value in controller.tuning)
    share = controller.smoothing
    a = np.concatenate([[1.0], process.a[output]])
    left = np.convolve(np.convolve(a, [1.0, -1.0]), [1.0, -share])
    law = np.array([gain + reset + rate, -gain - 2.0 * rate, rate]) * (1.0 - share)
    late = 1 + int(process.delay[output, valve]) + controller.lag
    right = np.concatenate([np.zeros(late), np.convolve(law, process.b[output, valve])])
    both = np.zeros(max(len(left), len(right)))
    both[: len(left)] += left
    both[: len(right)] += right
    poles = np.roots(np.trim_zeros(both, "b"))
    rounding = 1e-9 * np.abs(poles) + 1e-12
    real = np.abs(poles.imag) <= rounding
    turning = poles[(poles.imag > rounding) | (real & (poles.real < -rounding))]
    periods = 2 * np.pi / np.abs(np.angle(turning))
    growth = np.abs(turning) ** periods
    order = np.argsort(-growth)
    return tuple(Ringing(float(periods[i]), float(growth[i])) for i in order)
