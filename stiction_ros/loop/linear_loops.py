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
LANES = 8  # runs that go side by side: as many as a vector of the processor or two hold


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
def _in_lanes(values: FloatArray, first: int, by_lane: FloatArray) -> None:
    """Copy runs from ``first`` on, shape (R, n, q), side by side, shape (n, q, LANES)."""
    for lane in range(LANES):
        run = min(first + lane, len(values) - 1)
        for k in range(values.shape[1]):
            for i in range(values.shape[2]):
                by_lane[k, i, lane] = values[run, k, i]


@compiled
def run_loops(
    process: Process, controllers: Controllers, runs: Runs, sp: FloatArray, load: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return OP, shape (R, n, m), and PV, shape (R, n, p).

    Several runs go side by side, each computed as it would be alone.

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
    op_rows = np.full((number, whole - past, valves), np.inf)
    pv_rows = np.full((number, whole - past, outputs), np.inf)
    y, stem = np.empty((whole, outputs, LANES)), np.empty((whole, valves, LANES))
    wanted, added = np.empty((whole, outputs, LANES)), np.empty((whole, outputs, LANES))
    u, error = np.empty((valves, LANES)), np.zeros((valves, 2, LANES))
    friction, tuning = np.empty((valves, 2, LANES)), np.empty((valves, 3, LANES))
    value, bound, memory = np.empty(LANES), np.empty(LANES), np.zeros((valves, 6, LANES))
    ends = np.empty((valves, 2, LANES))
    op, gone = np.empty((whole, valves, LANES)), np.empty(LANES, dtype=np.int64)
    for first in range(0, number, LANES):
        _in_lanes(runs.pv, first, y)
        _in_lanes(runs.stem, first, stem)
        _in_lanes(runs.friction, first, friction)
        _in_lanes(runs.tuning, first, tuning)
        _in_lanes(sp, first, wanted)
        _in_lanes(load, first, added)
        for j in range(valves):
            ends[j, 0] = friction[j, 0] + friction[j, 1]
            ends[j, 1] = friction[j, 0] - friction[j, 1]
        for lane in range(LANES):
            run = min(first + lane, number - 1)
            size = 1.0
            for k in range(past):
                for i in range(outputs):
                    size = max(size, abs(y[k, i, lane]))
            bound[lane], gone[lane] = BEYOND * size, 0
            for j in range(valves):
                u[j, lane] = runs.op[run, j]
                at = stem[past - 1, j, lane]
                way = np.sign(at - stem[past - 2, j, lane])  # it moves on, or rests
                memory[j, 0, lane], memory[j, 3, lane] = at, at
                memory[j, 1, lane], memory[j, 2, lane] = u[j, lane], way
                memory[j, 4:, lane] = friction[j, 0, lane] if way == 0.0 else -1.0
                i = controllers.output[j]
                if i >= 0:
                    late = past - 1 - controllers.lag[j]
                    share = controllers.smoothing[j]
                    e = wanted[late - 2, i, lane] - y[late - 2, i, lane] - added[late - 2, i, lane]
                    for k in range(late - 2, late + 1):
                        away = wanted[k, i, lane] - y[k, i, lane] - added[k, i, lane]
                        e = share * e + (1.0 - share) * away
                        error[j, 1, lane] = error[j, 0, lane]
                        error[j, 0, lane] = e
        for k in range(past, whole):
            for i in range(outputs):
                for lane in range(LANES):
                    value[lane] = process.bias[i]
                for lag in range(na):
                    factor = process.a[i, lag]
                    for lane in range(LANES):
                        value[lane] -= factor * y[k - 1 - lag, i, lane]
                for j in range(valves):
                    shift = k - 1 - process.delay[i, j]
                    for lag in range(nb):
                        factor = process.b[i, j, lag]
                        for lane in range(LANES):
                            value[lane] += factor * stem[shift - lag, j, lane]
                for lane in range(LANES):
                    y[k, i, lane] = value[lane]
                    if gone[lane] == 0 and not abs(value[lane]) < bound[lane]:
                        gone[lane] = k
            for j in range(valves):
                i = controllers.output[j]
                if i >= 0:
                    late, share = k - controllers.lag[j], controllers.smoothing[j]
                    low, high = controllers.low[j], controllers.high[j]
                    for lane in range(LANES):
                        value[lane] = (
                            wanted[late, i, lane] - y[late, i, lane] - added[late, i, lane]
                        )
                    command(u[j], error[j], tuning[j], value, share, low, high)
                follows, slopes, factor = runs.laws[j, 0], runs.laws[j, 1], runs.laws[j, 2]
                if slopes:
                    slope_step(memory[j], u[j], friction[j, 1], ends[j])
                for lane in range(LANES):
                    op[k, j, lane] = u[j, lane]
                    apart = u[j, lane] - stem[k - 1, j, lane]
                    still = abs(apart) <= friction[j, 0, lane]
                    slip = -friction[j, 1, lane] if apart > 0.0 else friction[j, 1, lane]
                    if follows:
                        goes_on = memory[j, 2, lane] * (u[j, lane] - memory[j, 1, lane]) > 0.0
                        if not goes_on:
                            memory[j, 2, lane] = 0.0 if still else np.sign(apart)
                        still = still and not goes_on
                        slip = -memory[j, 2, lane] * friction[j, 1, lane]
                        memory[j, 1, lane] = u[j, lane]
                    slipped = u[j, lane] + slip
                    if factor != 1.0 and friction[j, 0, lane] > 0.0:
                        slipped = stem[k - 1, j, lane] + factor * (apart + slip)
                    stem[k, j, lane] = stem[k - 1, j, lane] if still else slipped
                    if slopes and friction[j, 0, lane] > 0.0:
                        stem[k, j, lane] = memory[j, 0, lane]
        for lane in range(min(LANES, number - first)):
            until = whole if gone[lane] == 0 else gone[lane] + 1
            for i in range(outputs):
                for k in range(past, until):
                    pv_rows[first + lane, k - past, i] = y[k, i, lane] + added[k, i, lane]
            for j in range(valves):
                for k in range(past, until):
                    op_rows[first + lane, k - past, j] = op[k, j, lane]
    return op_rows, pv_rows


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
