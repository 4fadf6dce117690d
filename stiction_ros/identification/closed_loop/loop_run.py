r"""Loops of controllers, sticky valves and a linear process, many at once, compiled.

Per sample and run: every PV by equation (9), every OP by the velocity form of its controller,

.. math:: u_k = u_{k-1} + K \Delta e_k + K_i e_k + K_d (\Delta e_k - \Delta e_{k-1})

with e behind its filter and as many samples late as the controller is, clipped to its limits,
every stem by He's law (4). A valve without a controller keeps its OP.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray

IntArray = np.ndarray[tuple[int, ...], np.dtype[np.int64]]

BEYOND = 1e6
"""Times the size of a start from which on a run is taken as gone."""


class Process(NamedTuple):
    """Equation (9) of p outputs and m valves.

    Attributes:
        a: a_1 … a_na, zeros behind, shape (p, na).
        b: b_1 … b_nb, zeros behind, shape (p, m, nb).
        delay: t_d, shape (p, m).
        bias: shape (p,).
    """

    a: FloatArray
    b: FloatArray
    delay: IntArray
    bias: FloatArray


class Controllers(NamedTuple):
    """One controller per valve; what is the same in all runs.

    Attributes:
        output: index of the output that it reads, −1 for none, shape (m,).
        lag: samples between PV and OP, shape (m,).
        smoothing: share of the last value in the filter of e, shape (m,).
        low, high: limits of OP, shape (m,).
    """

    output: IntArray
    lag: IntArray
    smoothing: FloatArray
    low: FloatArray
    high: FloatArray


class Runs(NamedTuple):
    """What differs from run to run, R runs.

    Attributes:
        friction: (f_S, f_D), shape (R, m, 2).
        tuning: (K, K_i, K_d), shape (R, m, 3).
        pv: before the first sample, oldest first, shape (R, p, H).
        stem: before the first sample, oldest first, shape (R, m, H).
        op: the last one before the first sample, shape (R, m).
    """

    friction: FloatArray
    tuning: FloatArray
    pv: FloatArray
    stem: FloatArray
    op: FloatArray


@compiled
def run_loops(
    process: Process, controllers: Controllers, runs: Runs, sp: FloatArray, load: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return OP, shape (R, n, m), and PV, shape (R, n, p).

    Args:
        process: of all runs.
        controllers: of all runs.
        runs: H, the samples before the first, is at least na, nb + the longest delay and 3 + the
            longest lag.
        sp: set-points, shape (R, H + n, p).
        load: added to PV behind the process, shape (R, H + n, p).
    """
    number, outputs, past = runs.pv.shape
    valves = runs.stem.shape[1]
    count = sp.shape[1] - past
    na, nb = process.a.shape[1], process.b.shape[2]
    op_rows = np.empty((number, count, valves))
    pv_rows = np.empty((number, count, outputs))
    for r in range(number):
        y = np.empty((past + count, outputs))
        stem = np.empty((past + count, valves))
        for k in range(past):
            for i in range(outputs):
                y[k, i] = runs.pv[r, i, k]
            for j in range(valves):
                stem[k, j] = runs.stem[r, j, k]
        size = 1.0
        for i in range(outputs):
            for k in range(past):
                size = max(size, abs(y[k, i]))
        command = runs.op[r].copy()
        error = np.zeros((valves, 3))
        for j in range(valves):
            i = controllers.output[j]
            if i >= 0:
                late = past - 1 - controllers.lag[j]
                share = controllers.smoothing[j]
                e = sp[r, late - 2, i] - y[late - 2, i] - load[r, late - 2, i]
                for back in range(3):
                    k = late - 2 + back
                    now = sp[r, k, i] - y[k, i] - load[r, k, i]
                    e = share * e + (1.0 - share) * now
                    error[j, 2 - back] = e
        gone = False
        for k in range(past, past + count):
            if gone:
                for i in range(outputs):
                    pv_rows[r, k - past, i] = np.inf
                for j in range(valves):
                    op_rows[r, k - past, j] = np.inf
                continue
            for i in range(outputs):
                value = process.bias[i]
                for lag in range(na):
                    value -= process.a[i, lag] * y[k - 1 - lag, i]
                for j in range(valves):
                    shift = k - 1 - process.delay[i, j]
                    for lag in range(nb):
                        value += process.b[i, j, lag] * stem[shift - lag, j]
                y[k, i] = value
                pv_rows[r, k - past, i] = value + load[r, k, i]
                if not abs(value) < BEYOND * size:
                    gone = True
            for j in range(valves):
                i = controllers.output[j]
                if i >= 0:
                    late = k - controllers.lag[j]
                    share = controllers.smoothing[j]
                    now = sp[r, late, i] - y[late, i] - load[r, late, i]
                    e = share * error[j, 0] + (1.0 - share) * now
                    change = e - error[j, 0]
                    value = command[j] + runs.tuning[r, j, 0] * change
                    value += runs.tuning[r, j, 1] * e
                    value += runs.tuning[r, j, 2] * (change - error[j, 0] + error[j, 1])
                    command[j] = min(max(value, controllers.low[j]), controllers.high[j])
                    error[j, 1] = error[j, 0]
                    error[j, 0] = e
                op_rows[r, k - past, j] = command[j]
                apart = command[j] - stem[k - 1, j]
                if apart > runs.friction[r, j, 0]:
                    stem[k, j] = command[j] - runs.friction[r, j, 1]
                elif apart < -runs.friction[r, j, 0]:
                    stem[k, j] = command[j] + runs.friction[r, j, 1]
                else:
                    stem[k, j] = stem[k - 1, j]
    return op_rows, pv_rows
