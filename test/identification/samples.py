"""All samples of signals that are held as steps."""

import numpy as np

from stiction_ros.effects import FloatArray
from stiction_ros.identification.switching import Cells, StepSignals


def dense(steps: StepSignals, channel: int) -> FloatArray:
    """Return all samples of one channel, shape (N, G)."""
    rows = []
    for low, high in zip(steps.offsets[:-1], steps.offsets[1:], strict=True):
        lengths = np.diff(np.append(steps.places[low:high], steps.count))
        rows.append(np.repeat(steps.values[low:high, channel], lengths))
    return np.array(rows).reshape(steps.size, steps.count).T


def bases(cells: Cells) -> FloatArray:
    """Return OP at the last slip, before the first slip the stem's level, shape (N, G)."""
    return dense(cells.steps, 0)


def stems(cells: Cells, dynamic: float) -> FloatArray:
    """Return the stems of cells at f_D, shape (N, G)."""
    return bases(cells) - dynamic * dense(cells.steps, 1)
