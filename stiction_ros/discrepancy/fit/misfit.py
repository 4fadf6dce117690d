"""How well every point of a grid explains a gap, under given noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from stiction_ros.discrepancy.candidate.base import Response
from stiction_ros.discrepancy.fit.misfit_kernels import left_of_shifts, taken_by_sizes
from stiction_ros.discrepancy.likelihood.noise import Blocks, left_by
from stiction_ros.effects import FloatArray
from stiction_ros.signals.autoregression import TINY, whiten


class Shared(Protocol):
    """What every fit of one gap shares: a :class:`~.baseline.Baseline`."""

    def basis(self, output: int, ar: FloatArray) -> FloatArray:
        """Return an orthonormal basis of the columns that every fit projects out, shape (n, r)."""
        ...

    @property
    def blocks(self) -> Sequence[Blocks]:
        """Return per output the fitted and the held-out rows."""
        ...


def misfit(
    base: Shared, gap: FloatArray, response: Response, ar: Mapping[int, FloatArray]
) -> FloatArray:
    """Return Σ n log(sum of squared innovations) for every point of a grid under given φ.

    Infinite where the response is that of figures which the effect cannot have.
    """
    total: FloatArray | float = 0.0
    for i in response.outputs:
        marked = base.blocks[i].train
        basis = base.basis(i, ar[i])
        rows = np.flatnonzero(marked)
        target = left_by(basis, whiten(gap[:, i], ar[i])[marked])
        shift, sizes = response.shifts.get(i), response.sizes.get(i)
        if shift is not None:
            squares = left_of_shifts(target, np.ascontiguousarray(shift), rows, basis, ar[i])
        else:
            assert sizes is not None
            columns, across = np.ascontiguousarray(sizes), np.ascontiguousarray(basis.T)
            squares = target @ target - taken_by_sizes(target, columns, marked, across, ar[i])
        total = total + len(rows) * np.log(np.maximum(squares, TINY))
    if response.possible is not None:
        total = np.where(response.possible, total, np.inf)
    return np.asarray(total)
