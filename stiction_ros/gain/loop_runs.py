r"""Loops run again under what came from outside, many at once, compiled.

Per sample and run: every PV by its equation and by what the record adds to it,

.. math:: y_k = -\sum_i a_i y_{k-i} + \sum_j \sum_i b_{j,i} \chi^{(j)}_{k-i-d_j} + \epsilon_k

every OP by the velocity form of its controller and every stem by He's law (4), both as in
:mod:`stiction_ros.identification.closed_loop.loop_run`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.closed_loop.loop_run import Controllers

BEYOND = 1e4
"""Times the size of the record from which on a run is taken as gone."""


class Equations(NamedTuple):
    """Of each of R runs, p outputs and m valves.

    Attributes:
        a: a_1 … a_n, shape (R, p, n).
        b: b_1 … b_n, shape (R, p, m, n).
        delay: d, the same in all runs, shape (p, m).
        outside: ε, shape (R, p, N), the constant and waves in it.
    """

    a: FloatArray
    b: FloatArray
    delay: IntArray
    outside: FloatArray


class Valves(NamedTuple):
    """Valves and controllers of each run.

    Attributes:
        friction: (f_S, f_D), shape (R, m, 2).
        tuning: (K, K_i, K_d), shape (R, m, 3).
        stems: before the first sample that is run, from the first of the record on, (R, m, H).
    """

    friction: FloatArray
    tuning: FloatArray
    stems: FloatArray


@compiled
def run_again(
    equations: Equations,
    controllers: Controllers,
    valves: Valves,
    recorded: tuple[FloatArray, FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return PV, shape (R, n, p), OP and stems, shape (R, n, m), from sample H on; n = N − H.

    Args:
        equations: of all runs.
        controllers: of all runs.
        valves: H is at least the lags and the longest delay, and 3 + the longest lag of OP.
        recorded: OP, shape (N, m), PV and set-point, shape (N, p).
    """
    op, pv, sp = recorded
    number, count, past = equations.a.shape[0], len(pv), valves.stems.shape[2]
    outputs, lags, ends = pv.shape[1], equations.a.shape[2], op.shape[1]
    pv_rows = np.empty((number, count - past, outputs))
    op_rows = np.empty((number, count - past, ends))
    stem_rows = np.empty((number, count - past, ends))
    size = 1.0
    for k in range(count):
        for i in range(outputs):
            size = max(size, abs(pv[k, i]))
    for r in range(number):
        y = pv.copy()
        stem = np.empty((count, ends))
        for j in range(ends):
            for k in range(past):
                stem[k, j] = valves.stems[r, j, k]
        command = op[past - 1].copy()
        error = np.zeros((ends, 3))
        for j in range(ends):
            i = controllers.output[j]
            if i >= 0:
                late = past - 1 - controllers.lag[j]
                share = controllers.smoothing[j]
                e = sp[late - 2, i] - y[late - 2, i]
                for back in range(3):
                    k = late - 2 + back
                    e = share * e + (1.0 - share) * (sp[k, i] - y[k, i])
                    error[j, 2 - back] = e
        gone = False
        for k in range(past, count):
            row = k - past
            if gone:
                pv_rows[r, row], op_rows[r, row], stem_rows[r, row] = np.inf, np.inf, np.inf
                continue
            for i in range(outputs):
                value = equations.outside[r, i, k]
                for lag in range(lags):
                    value -= equations.a[r, i, lag] * y[k - 1 - lag, i]
                for j in range(ends):
                    shift = k - 1 - equations.delay[i, j]
                    for lag in range(lags):
                        value += equations.b[r, i, j, lag] * stem[shift - lag, j]
                y[k, i] = value
                pv_rows[r, row, i] = value
                if not abs(value) < BEYOND * size:
                    gone = True
            for j in range(ends):
                i = controllers.output[j]
                if i >= 0:
                    late = k - controllers.lag[j]
                    share = controllers.smoothing[j]
                    e = share * error[j, 0] + (1.0 - share) * (sp[late, i] - y[late, i])
                    change = e - error[j, 0]
                    value = command[j] + valves.tuning[r, j, 0] * change
                    value += valves.tuning[r, j, 1] * e
                    value += valves.tuning[r, j, 2] * (change - error[j, 0] + error[j, 1])
                    command[j] = min(max(value, controllers.low[j]), controllers.high[j])
                    error[j, 1] = error[j, 0]
                    error[j, 0] = e
                op_rows[r, row, j] = command[j]
                apart = command[j] - stem[k - 1, j]
                if apart > valves.friction[r, j, 0]:
                    stem[k, j] = command[j] - valves.friction[r, j, 1]
                elif apart < -valves.friction[r, j, 0]:
                    stem[k, j] = command[j] + valves.friction[r, j, 1]
                else:
                    stem[k, j] = stem[k - 1, j]
                stem_rows[r, row, j] = stem[k, j]
    return pv_rows, op_rows, stem_rows
