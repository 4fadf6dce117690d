"""How a loop without friction rings: the poles of controller and process together."""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop.linear_loops import Process


@dataclasses.dataclass(frozen=True)
class Ringing:
    """One oscillation of a linear loop."""

    period: float  # samples
    growth: float  # share of an oscillation that is left after one period; 1 and more is sustained


def ringing(
    process: Process,
    output: int,
    valve: int,
    tuning: FloatArray,
    lag: int = 0,
    smoothing: float = 0.0,
) -> tuple[Ringing, ...]:
    r"""Return the oscillations of one valve and one output, the least damped first.

    The roots of

    .. math:: A(q)(1 - q)(1 - s q) + (1 - s) C(q) B(q) q^{1 + t_d + lag}, \quad
              C = K (1 - q) + K_i + K_d (1 - q)^2

    in the backward shift q, over which the loop is closed, are the inverse poles. One on the
    negative axis rings from sample to sample, with a period of two.

    Args:
        process: of all outputs and valves.
        output, valve: indices.
        tuning: (K, K_i, K_d) of the controller between them, shape (3,).
        lag: samples between PV and OP.
        smoothing: share s of the last value in the filter of the error.
    """
    gain, reset, rate = tuning.tolist()
    a = np.concatenate([[1.0], process.a[output]])
    left = np.convolve(np.convolve(a, [1.0, -1.0]), [1.0, -smoothing])
    law = np.array([gain + reset + rate, -gain - 2.0 * rate, rate]) * (1.0 - smoothing)
    late = 1 + int(process.delay[output, valve]) + lag
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
