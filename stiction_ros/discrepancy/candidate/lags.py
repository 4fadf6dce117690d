"""What lags of a valve, a process and a sensor have in common."""

from __future__ import annotations

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Axis, FloatArray

LEAST_LAG = 2.5  # times the shortest lag that is searched, a fifth of a sample


def lasts(candidate: Candidate, point: FloatArray) -> bool:
    """Tell whether a lag is longer than half a sample.

    Between samples a signal moves on: less than one of them may be the sampling's own.
    """
    return float(point[0]) >= LEAST_LAG * candidate.axes[0].low


def late_axes(asked: bool) -> tuple[Axis, ...]:
    """Return the axis of how late within a sample a lag moves on; none where that is not asked."""
    return (Axis(-1.0, 1.0, 1, linear=True),) if asked else ()


def later(values: FloatArray, late: FloatArray, run: FreeRun) -> FloatArray:
    """Return signals that come late by a share of a sample.

    Args:
        values: shape (N, G).
        late: samples, shape (G, 1); shape (G, 0) where that is not asked.
        run: whose records they are of.
    """
    for share in late.T:
        for rows in run.runs.slices:
            values[rows][1:] -= share * np.diff(values[rows], axis=0)
    return values


def lag_axis(run: FreeRun) -> Axis:
    """Return the range of time constants that a record tells."""
    step = run.runs.sample_time
    return Axis(0.2 * step, max(len(run.runs) / 8.0, 2.0) * step, 20, logarithmic=True)
