"""Plans of a controller as messages carry them, and those that are made before the first sample."""

import dataclasses

import numpy as np

from stiction_ros.control import ControlMode, MpcController, StepResult
from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.controller.live import LiveController
from stiction_ros.online.controller.settings import LiveControllerSettings

STEPS = 3  # of a rehearsal
FRICTION = HeStiction(5.0, 2.0)  # of its valves


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


def rehearse(settings: LiveControllerSettings, model: LoopModel) -> None:
    """Load and warm what a step needs, before and after a swap; nothing is left of it.

    The first step of a process takes ten times as long as those that follow: solvers are
    loaded, and memory is laid out.
    """
    sticky = model.with_valve_effects({name: [FRICTION] for name in model.valve_names})
    for mode in (ControlMode.UNAWARE, ControlMode.EMBEDDING):
        try:
            live = LiveController(dataclasses.replace(settings, mode=mode.value), sticky)
        except InputError:  # these settings know this friction only; the swap would say why
            continue
        for k in range(STEPS):
            result = live.step(model.pv0, model.pv0 + 0.01 * k)
        thinned_plan(live.observed, result, 2)
        live.close()
