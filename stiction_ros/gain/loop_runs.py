r"""Loops run again under what came from outside, many at once, sample by sample.

Per sample and run: every PV by its equation and by what the record adds to it,

.. math:: y_k = -\sum_i a_i y_{k-i} + \sum_j \sum_i b_{j,i} \chi^{(j)}_{k-i-d_j} + \epsilon_k

every OP by its controller, and every stem by the law of its valve.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, FloatArray, IntArray
from stiction_ros.identification.closed_loop.loop_run import Controllers
from stiction_ros.identification.closed_loop.scaled_loop import ScaledLoop

BEYOND = 1e4
"""Times the size of the record from which on a run is taken as gone."""

Control = Callable[[int, FloatArray, FloatArray], None]
"""Sets OP of sample k, shape (R, N, m), by PV, shape (R, N, p), up to it."""

Laws = Sequence[Sequence[Behaviour | None]]
"""Law of each valve of each run; None where the stem follows OP."""


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


class Stems:
    """The valves of R runs, which go on from the recorded OP."""

    def __init__(self, laws: Laws, loop: ScaledLoop, rows: slice, sample_time: float) -> None:
        """Let every valve, its law in %, follow the recorded OP of ``rows`` from its stem on."""
        self._laws, self._sample_time, self._count = laws, sample_time, 0
        self._mean, self._scale = loop.op_mean, loop.op_scale
        begun = (loop.stem[rows.start] * self._scale + self._mean).tolist()
        self._memories = [
            [law.rest(at) if law else at for law, at in zip(row, begun, strict=True)]
            for row in laws
        ]
        for op in loop.op[rows]:
            self.step(np.repeat(op[None], len(laws), axis=0))

    def step(self, op: FloatArray) -> FloatArray:
        """Return the stems for the next OP, scaled, shape (R, m) both."""
        stems = (op * self._scale + self._mean).tolist()
        time = self._count * self._sample_time
        for laws, memories, row in zip(self._laws, self._memories, stems, strict=True):
            for j, law in enumerate(laws):
                if law is not None:
                    memories[j], row[j] = law.step(memories[j], row[j], time)
        self._count += 1
        return np.asarray((np.array(stems) - self._mean) / self._scale)


class RecoveredControl:
    """The controllers of R runs as recovered, in the velocity form of the closed loop."""

    def __init__(
        self, controllers: Controllers, tunings: FloatArray, sp: FloatArray, pv: FloatArray
    ) -> None:
        """Follow the recorded errors.

        Args:
            controllers: one a valve; a valve without one keeps the recorded OP.
            tunings: (K, K_i, K_d), shape (R, m, 3).
            sp: shape (N, p).
            pv: recorded before the first sample that is run, shape (H, p).
        """
        self._controllers, self._tunings, self._sp = controllers, tunings, sp
        self._errors = np.zeros((len(tunings), len(sp), len(controllers.output)))
        for j, lag in enumerate(controllers.lag.tolist()):
            for k in range(lag, len(pv)):
                self._error(k, j, pv[None])

    def _error(self, k: int, j: int, pv: FloatArray) -> None:
        """Set the filtered error that a controller acts on at sample k."""
        output, lag, smoothing, _, _ = self._controllers
        late, share = k - lag[j], smoothing[j] if k > lag[j] else 0.0
        new = self._sp[late, output[j]] - pv[:, late, output[j]]
        self._errors[:, k, j] = share * self._errors[:, k - 1, j] + (1.0 - share) * new

    def __call__(self, k: int, pv: FloatArray, op: FloatArray) -> None:
        """Set OP of sample k, see :data:`Control`."""
        for j, output in enumerate(self._controllers.output):
            if output < 0:
                continue
            self._error(k, j, pv)
            older, before, error = self._errors[:, k - 2 : k + 1, j].T
            change = error - before
            gain, reset, rate = self._tunings[:, j].T
            moved = op[:, k - 1, j] + gain * change + reset * error
            moved += rate * (change - before + older)
            low, high = self._controllers.low[j], self._controllers.high[j]
            op[:, k, j] = np.minimum(np.maximum(moved, low), high)


def run_again(
    equations: Equations,
    stems: FloatArray,
    valves: Stems,
    control: Control,
    loop: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Return PV, shape (R, n, p), and stems, shape (R, n, m), from sample H on; n = N − H.

    Args:
        equations: of all runs.
        stems: before sample H, shape (R, m, H); H is at least the lags and the longest delay, and
            3 + the longest lag of OP.
        valves: which have followed OP up to there.
        control: of all valves; what it does not set stays as recorded.
        loop: recorded OP, shape (N, m), and PV, shape (N, p).

    Returns:
        PV is infinite throughout in a run that grows without end.
    """
    a, b, delay, outside = equations
    (number, _, lags), past = a.shape, stems.shape[2]
    back_a, back_b = a[..., ::-1], b[..., ::-1]
    op, pv = (np.repeat(values[None], number, axis=0) for values in loop)
    moved = np.empty_like(op)
    moved[:, :past] = stems.transpose(0, 2, 1)
    bound = BEYOND * max(float(np.abs(pv).max()), 1.0)
    for k in range(past, pv.shape[1]):
        for i, late in enumerate(delay.tolist()):
            value = outside[:, i, k] - np.einsum("rn,rn->r", back_a[:, i], pv[:, k - lags : k, i])
            for j, shift in enumerate(late):
                window = moved[:, k - shift - lags : k - shift, j]
                value += np.einsum("rn,rn->r", back_b[:, i, j], window)
            pv[:, k, i] = np.minimum(np.maximum(value, -bound), bound)
        control(k, pv, op)
        moved[:, k] = valves.step(op[:, k])
    pv[(np.abs(pv) >= bound).any(axis=(1, 2))] = np.inf
    return pv[:, past:], moved[:, past:]
