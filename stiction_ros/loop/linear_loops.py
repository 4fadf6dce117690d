"""Loops of controllers, sticky valves and a linear process, many at once, compiled.

A valve without a controller keeps its OP.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.effects.grid_kernels import slope_step
from stiction_ros.signals.recovered_controller import RecoveredController

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
    """One controller per valve; what is the same in all runs."""

    output: IntArray  # index of the output that it reads, −1 for none, shape (m,)
    lag: IntArray  # samples between PV and OP, shape (m,)
    smoothing: FloatArray  # share of the last value in the filter of e, shape (m,)
    low: FloatArray  # low, high: limits of OP, shape (m,)
    high: FloatArray

    @classmethod
    def of(cls, pairs: Pairs) -> "Controllers":
        """Return controllers as they were recovered, each with the output that it reads."""
        outputs, laws = zip(*pairs, strict=True)
        low, high = np.array([law.limits for law in laws]).T.copy()
        smoothing = np.array([law.smoothing for law in laws])
        return cls(np.array(outputs), np.array([law.lag for law in laws]), smoothing, low, high)


class Runs(NamedTuple):
    """What differs from run to run, R runs."""

    friction: FloatArray  # (f_S, f_D), shape (R, m, 2)
    tuning: FloatArray  # (K, K_i, K_d), shape (R, m, 3)
    pv: FloatArray  # before the first sample, oldest first, shape (R, H, p)
    stem: FloatArray  # before the first sample, oldest first, shape (R, H, m)
    op: FloatArray  # the last one before the first sample, shape (R, m)
    # per valve, whether Kano's or Choudhury's rules move its stem in place of He's law (4), and by
    # which factor a slip is longer than He's, shape (m, 3)
    laws: FloatArray


@compiled
def command(
    op: FloatArray,
    error: FloatArray,
    tuning: FloatArray,
    now: FloatArray,
    share: float,
    low: float,
    high: float,
) -> None:
    r"""Move OP by a sample, by the velocity form of a controller.

    .. math:: u_k = u_{k-1} + K \Delta e_k + K_i e_k + K_d (\Delta e_k - \Delta e_{k-1})

    e is behind its filter, and OP is clipped to its limits.

    Args:
        op: of the sample before, shape (R,).
        error: e of the sample before and of that before it, shape (2, R).
        tuning: (K, K_i, K_d), shape (3, R).
        now: SP − PV that the controller reads, shape (R,).
        share: of the last value in the filter of e.
        low, high: limits of OP.
    """
    for run in range(len(op)):
        before = error[0, run]
        e = share * before + (1.0 - share) * now[run]
        change = e - before
        moved = op[run] + tuning[0, run] * change
        moved += tuning[1, run] * e
        moved += tuning[2, run] * (change - before + error[1, run])
        moved = low if moved < low else moved
        op[run] = high if moved > high else moved
        error[1, run] = before
        error[0, run] = e


@compiled
def run_loops(
    process: Process, controllers: Controllers, runs: Runs, sp: FloatArray, load: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return OP, shape (R, n, m), and PV, shape (R, n, p).

    All runs go side by side, each computed as it would be alone.

    Args:
        process: of all runs.
        controllers: of all runs.
        runs: H, the samples before the first, is at least na, nb + the longest delay and 3 + the
            longest lag.
        sp: set-points, shape (R, H + n, p).
        load: added to PV behind the process, shape (R, H + n, p).
    """
    number, past, outputs = runs.pv.shape
    valves, whole = runs.stem.shape[2], sp.shape[1]
    na, nb = process.a.shape[1], process.b.shape[2]
    y, stem = np.empty((whole, outputs, number)), np.empty((whole, valves, number))
    y[:past], stem[:past] = runs.pv.transpose(1, 2, 0), runs.stem.transpose(1, 2, 0)
    wanted = np.ascontiguousarray(sp.transpose(1, 2, 0))
    added = np.ascontiguousarray(load.transpose(1, 2, 0))
    friction = np.ascontiguousarray(runs.friction.transpose(1, 2, 0))
    tuning = np.ascontiguousarray(runs.tuning.transpose(1, 2, 0))
    u, error = np.ascontiguousarray(runs.op.T), np.zeros((valves, 2, number))
    ends, memory = np.empty((valves, 2, number)), np.zeros((valves, 6, number))
    value, bound = np.empty(number), np.empty(number)
    op, gone = np.empty((whole, valves, number)), np.zeros(number, dtype=np.int64)
    for run in range(number):
        bound[run] = BEYOND * max(1.0, np.abs(y[:past, :, run]).max())
        for j in range(valves):
            ends[j, 0, run] = friction[j, 0, run] + friction[j, 1, run]
            ends[j, 1, run] = friction[j, 0, run] - friction[j, 1, run]
            at = stem[past - 1, j, run]
            way = np.sign(at - stem[past - 2, j, run])  # it moves on, or rests
            memory[j, 0, run], memory[j, 3, run] = at, at
            memory[j, 1, run], memory[j, 2, run] = u[j, run], way
            memory[j, 4:, run] = friction[j, 0, run] if way == 0.0 else -1.0
            i = controllers.output[j]
            if i >= 0:
                late = past - 1 - controllers.lag[j]
                share = controllers.smoothing[j]
                e = wanted[late - 2, i, run] - y[late - 2, i, run] - added[late - 2, i, run]
                for k in range(late - 2, late + 1):
                    away = wanted[k, i, run] - y[k, i, run] - added[k, i, run]
                    e = share * e + (1.0 - share) * away
                    error[j, 1, run] = error[j, 0, run]
                    error[j, 0, run] = e
    for k in range(past, whole):
        for i in range(outputs):
            for run in range(number):
                value[run] = process.bias[i]
            for lag in range(na):
                factor = process.a[i, lag]
                for run in range(number):
                    value[run] -= factor * y[k - 1 - lag, i, run]
            for j in range(valves):
                shift = k - 1 - process.delay[i, j]
                for lag in range(nb):
                    factor = process.b[i, j, lag]
                    for run in range(number):
                        value[run] += factor * stem[shift - lag, j, run]
            for run in range(number):
                y[k, i, run] = value[run]
                if gone[run] == 0 and not abs(value[run]) < bound[run]:
                    gone[run] = k
        for j in range(valves):
            i = controllers.output[j]
            if i >= 0:
                late, share = k - controllers.lag[j], controllers.smoothing[j]
                low, high = controllers.low[j], controllers.high[j]
                for run in range(number):
                    value[run] = wanted[late, i, run] - y[late, i, run] - added[late, i, run]
                command(u[j], error[j], tuning[j], value, share, low, high)
            follows, slopes, factor = runs.laws[j, 0], runs.laws[j, 1], runs.laws[j, 2]
            if slopes:
                slope_step(memory[j], u[j], friction[j, 1], ends[j])
            for run in range(number):
                op[k, j, run] = u[j, run]
                apart = u[j, run] - stem[k - 1, j, run]
                still = abs(apart) <= friction[j, 0, run]
                slip = -friction[j, 1, run] if apart > 0.0 else friction[j, 1, run]
                if follows:
                    goes_on = memory[j, 2, run] * (u[j, run] - memory[j, 1, run]) > 0.0
                    if not goes_on:
                        memory[j, 2, run] = 0.0 if still else np.sign(apart)
                    still = still and not goes_on
                    slip = -memory[j, 2, run] * friction[j, 1, run]
                    memory[j, 1, run] = u[j, run]
                slipped = u[j, run] + slip
                if factor != 1.0 and friction[j, 0, run] > 0.0:
                    slipped = stem[k - 1, j, run] + factor * (apart + slip)
                stem[k, j, run] = stem[k - 1, j, run] if still else slipped
                if slopes and friction[j, 0, run] > 0.0:
                    stem[k, j, run] = memory[j, 0, run]
    seen = y + added
    for run in range(number):
        if gone[run]:
            op[gone[run] + 1 :, :, run] = np.inf
            seen[gone[run] + 1 :, :, run] = np.inf
    op, seen = op[past:].transpose(2, 0, 1), seen[past:].transpose(2, 0, 1)
    return np.ascontiguousarray(op), np.ascontiguousarray(seen)


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
