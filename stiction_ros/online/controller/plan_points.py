"""The plan of a step as the points that a message carries."""

import numpy as np

from stiction_ros.control import MpcController, StepResult
from stiction_ros.effects.behaviour import FloatArray


def thinned_plan(
    controller: MpcController, result: StepResult, points: int
) -> tuple[FloatArray, FloatArray]:
    """Return the plan of a step in ``points`` rows at most.

    Args:
        controller: that planned.
        result: of its last step.
        points: rows, the first and the last of the plan among them.

    Returns:
        Rows (PV, stem), shape (K, p + m), and the samples ahead that they stand for,
        shape (K,). The first row is the present estimate; without a plan it is alone.
    """
    stem, plan = controller.stem, result.plan
    if plan is None:
        return np.concatenate([controller.observer.output, stem])[None], np.zeros(1)
    pv, stems = plan.pv[result.age :], plan.stem[result.age :]
    last = len(stems)
    picks = np.unique(np.linspace(0, last, min(points, last + 1)).round().astype(int))
    rows = np.hstack([pv[picks], stems[np.minimum(picks, last - 1)]])
    rows[0, pv.shape[1] :] = stem
    return rows, picks
