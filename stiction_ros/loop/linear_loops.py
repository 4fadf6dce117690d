"""Loops of controllers, sticky valves and a linear process, compiled.

A valve without a controller keeps its OP.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.effects.grid_kernels import slope_step
from stiction_ros.signals.controller_recovery import RecoveredController

Pairs = Sequence[tuple[int, RecoveredController]]
"""Per valve the output of its controller, −1 for none, and the controller."""

BEYOND = 1e6  # times the size of a start from which on a run is taken as gone


class Process(NamedTuple):
    """Equation (9) of p outputs and m valves."""

    a: FloatArray  # a_1 … a_na, zeros behind, shape (p, na)
    b: FloatArray  # b_1 … b_nb, zeros behind, shape (p, m, nb)
    delay: IntArray  # t_d, shape (p, m)
    bias: FloatArray  # shape (p,)


class Controllers(NamedTuple):
    """One controller per valve."""

    output: IntArray  # index of the output that it reads, −1 for none, shape (m,)
    lag: IntArray  # samples between PV and OP, shape (m,)
    smoothing: FloatArray  # share of the last value in the filter of e, shape (m,)
    low: FloatArray  # low, high: limits of OP, shape (m,)
    high: FloatArray
    tuning: FloatArray  # (K, K_i, K_d), shape (m, 3)

    @classmethod
    def of(cls, pairs: Pairs) -> "Controllers":
        """Return controllers as they were recovered, each with the output that it reads."""
        outputs, laws = zip(*pairs, strict=True)
        low, high = np.array([law.limits for law in laws]).T.copy()
        smoothing = np.array([law.smoothing for law in laws])
        tuning = np.array([law.coefficients for law in laws])
        lags = np.array([law.lag for law in laws])
        return cls(np.array(outputs), lags, smoothing, low, high, tuning)


class Valves(NamedTuple):
    """The stems of m valves, which follow He's law (4) unless their laws say otherwise."""

    friction: FloatArray  # (f_S, f_D), shape (m, 2)
    # whether Kano's or Choudhury's rules move the stem, and by which factor a slip is longer than
    # He's, shape (m, 3)
    laws: FloatArray


class Start(NamedTuple):
    """What was before the first sample, the oldest first."""

    pv: FloatArray  # shape (H, p)
    stem: FloatArray  # shape (H, m)
    op: FloatArray  # the last one, shape (m,)


def command(
    op: Any, errors: tuple[Any, Any], tuning: Any, now: Any, filtered: tuple[float, float, float]
) -> tuple[Any, tuple[Any, Any]]:
    r"""Return OP of the next sample by the velocity form of a controller, and the errors then.

    .. math:: u_k = u_{k-1} + K \Delta e_k + K_i e_k + K_d (\Delta e_k - \Delta e_{k-1})

    e is behind its filter, and OP is clipped to its limits. Of one run or of all at once: each
    argument is a number, or an array of one for each run.

    Args:
        op: of the sample before.
        errors: e of the sample before and of that before it.
        tuning: (K, K_i, K_d).
        now: SP − PV that the controller reads.
        filtered: share of the last value in the filter of e, and the limits of OP.
    """
    (before, older), (share, low, high) = errors, filtered
    e = share * before + (1.0 - share) * now
    change = e - before
    moved = op + tuning[0] * change + tuning[1] * e + tuning[2] * (change - before + older)
    return np.minimum(np.maximum(moved, low), high), (e, before)


_command = compiled(command)


@compiled
def run_loop(
    process: Process,
    controllers: Controllers,
    valves: Valves,
    start: Start,
    outside: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Return OP, shape (n, m), and PV, shape (n, p), of a loop; infinite from where it is gone.

    Args:
        process: of the loop.
        controllers: of the loop.
        valves: of the loop.
        start: H samples, at least na, nb + the longest delay and 3 + the longest lag.
        outside: set-points, and what is added to PV behind the process, shape (H + n, p) each.
    """
    (sp, load), (friction, laws) = outside, valves
    (past, outputs), whole = start.pv.shape, len(sp)
    y, stem = np.empty((whole, outputs)), np.empty((whole, len(laws)))
    y[:past], stem[:past] = start.pv, start.stem
    u, error, memory = start.op.copy(), np.zeros((len(laws), 2)), np.zeros((len(laws), 6))
    op, bound = np.full((whole, len(laws)), np.inf), BEYOND * max(1.0, np.abs(start.pv).max())
    for j, i in enumerate(controllers.output):
        at = stem[past - 1, j]
        way = np.sign(at - stem[past - 2, j])  # it moves on, or rests
        memory[j, 0], memory[j, 1], memory[j, 2], memory[j, 3] = at, u[j], way, at
        memory[j, 4:] = friction[j, 0] if way == 0.0 else -1.0
        if i >= 0:
            late, share = past - 1 - controllers.lag[j], controllers.smoothing[j]
            e = sp[late - 2, i] - y[late - 2, i] - load[late - 2, i]
            for k in range(late - 2, late + 1):
                e = share * e + (1.0 - share) * (sp[k, i] - y[k, i] - load[k, i])
                error[j, 1], error[j, 0] = error[j, 0], e
    gone = False
    for k in range(past, whole):
        for i in range(outputs):
            value = process.bias[i]
            for lag in range(process.a.shape[1]):
                value -= process.a[i, lag] * y[k - 1 - lag, i]
            for j in range(len(laws)):
                shift = k - 1 - process.delay[i, j]
                for lag in range(process.b.shape[2]):
                    value += process.b[i, j, lag] * stem[shift - lag, j]
            y[k, i] = value
            gone = gone or not abs(value) < bound
        for j, i in enumerate(controllers.output):
            if i >= 0:
                late = k - controllers.lag[j]
                now = sp[late, i] - y[late, i] - load[late, i]
                errors = error[j, 0], error[j, 1]
                filtered = controllers.smoothing[j], controllers.low[j], controllers.high[j]
                u[j], errors = _command(u[j], errors, controllers.tuning[j], now, filtered)
                error[j, 0], error[j, 1] = errors
            op[k, j] = u[j]
            static, dynamic = friction[j]
            follows, slopes, factor = laws[j]
            if slopes:
                slope_step(memory[j], u[j], dynamic, static + dynamic, static - dynamic)
            apart = u[j] - stem[k - 1, j]
            still = abs(apart) <= static
            slip = -dynamic if apart > 0.0 else dynamic
            if follows:
                goes_on = memory[j, 2] * (u[j] - memory[j, 1]) > 0.0
                if not goes_on:
                    memory[j, 2] = 0.0 if still else np.sign(apart)
                still = still and not goes_on
                slip = -memory[j, 2] * dynamic
                memory[j, 1] = u[j]
            slipped = u[j] + slip
            if factor != 1.0 and static > 0.0:
                slipped = stem[k - 1, j] + factor * (apart + slip)
            stem[k, j] = stem[k - 1, j] if still else slipped
            if slopes and static > 0.0:
                stem[k, j] = memory[j, 0]
        if gone:
            y[k + 1 :] = np.inf
            break
    return op[past:], y[past:] + load[past:]


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
