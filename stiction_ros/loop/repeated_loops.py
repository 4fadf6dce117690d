r"""Loops run again under what came from outside, many at once, sample by sample.

In each sample of each run, every PV follows from its equation and from the rest ε of the record,

.. math:: y_k = -\sum_i a_i y_{k-i} + \sum_j \sum_i b_{j,i} \chi^{(j)}_{k-i-d_j} + \epsilon_k

Every OP follows from its controller, which may be of any kind. Every stem follows from the law of
its valve, which may be any law.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, FloatArray, IntArray
from stiction_ros.loop.linear_loops import Controllers, command
from stiction_ros.signals.controller_recovery import smoothed

BEYOND = 1e4  # times the size of the record from which on a run is taken as gone

# sets OP of sample k, shape (R, N, m), by PV, shape (R, N, p), up to it
Control = Callable[[int, FloatArray, FloatArray], None]
Laws = Sequence[Sequence[Behaviour | None]]  # of each valve of each run; None: ideal


class Equations(NamedTuple):
    """Of each of R runs, p outputs and m valves."""

    a: FloatArray  # a_1 … a_n, shape (R, p, n)
    b: FloatArray  # b_1 … b_n, shape (R, p, m, n)
    delay: IntArray  # d, the same in all runs, shape (p, m)
    outside: FloatArray  # ε, shape (R, p, N), the constant and waves in it


class Stems:
    """The valves of R runs, which go on from the recorded OP."""

    def __init__(
        self,
        laws: Laws,
        op: FloatArray,
        start: FloatArray,
        units: tuple[FloatArray, FloatArray],
        sample_time: float,
    ) -> None:
        """Let every valve, its law in %, follow a recorded OP from its stem on.

        OP, shape (H, m), and the stems at its first sample, shape (m,), are scaled by the
        ``units``: mean and scale of OP, %, shape (m,) each.
        """
        self._laws, self._sample_time, self._count = laws, sample_time, 0
        self._mean, self._scale = units
        begun = (start * self._scale + self._mean).tolist()
        self._memories = [
            [law.rest(at) if law else at for law, at in zip(row, begun, strict=True)]
            for row in laws
        ]
        for row in op:
            self.step(np.repeat(row[None], len(laws), axis=0))

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
    """The controllers of R runs as recovered."""

    def __init__(
        self, controllers: Controllers, tunings: FloatArray, sp: FloatArray, pv: FloatArray
    ) -> None:
        """Follow the recorded errors of SP, (N, p), and PV before the first sample, (H, p).

        The ``tunings`` are (K, K_i, K_d), shape (R, m, 3). A valve without one of the
        ``controllers`` keeps the recorded OP.
        """
        columns = (each.tolist() for each in controllers[:5])
        self._rows = [(i, lag, tuple(rest)) for i, lag, *rest in zip(*columns, strict=True)]
        self._sp = sp
        self._tunings = tunings.transpose(1, 2, 0)
        away = sp[: len(pv)] - pv
        pasts = [
            smoothed(np.ascontiguousarray(away[: len(pv) - lag, output]), share)
            for output, lag, (share, *_) in self._rows
        ]
        self._errors: list[tuple[Any, Any]] = [(past[-1], past[-2]) for past in pasts]

    def __call__(self, k: int, pv: FloatArray, op: FloatArray) -> None:
        """Set OP of sample k, see :data:`Control`."""
        for j, (i, lag, filtered) in enumerate(self._rows):
            if i >= 0:
                now, before = self._sp[k - lag, i] - pv[:, k - lag, i], op[:, k - 1, j]
                op[:, k, j], self._errors[j] = command(
                    before, self._errors[j], self._tunings[j], now, filtered
                )


def run_again(
    equations: Equations,
    stems: FloatArray,
    valves: Stems,
    control: Control,
    loop: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Return PV, shape (R, n, p), and stems, shape (R, n, m), from sample H on; n = N − H.

    The ``stems`` are those before sample H, shape (R, m, H), up to which the ``valves`` have
    followed OP; H is at least the lags and the longest delay, and 3 + the longest lag of OP. What
    ``control`` does not set stays as in the ``loop``: recorded OP, shape (N, m), and PV, (N, p).
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
