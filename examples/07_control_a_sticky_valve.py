"""Predictive control that knows the friction, beside one that does not.

For researchers. Example 1: f_S = 5 %, f_D = 2 %; the plant sticks in both runs.
"""

import numpy as np

from stiction_ros import (
    ControlMode,
    ControlSettings,
    HeStiction,
    LoopModel,
    MpcController,
    SetPoints,
    find_config,
    simulate_closed_loop,
)

SETTINGS = ControlSettings(horizon=60, observer="kalman")


def run(mode: ControlMode, samples: int) -> float:
    """Return the mean |SP − PV| of the plant under the controller of ``mode``."""
    plant = LoopModel.load(find_config("example1.loop.yaml"))
    process = LoopModel.load(find_config("example1_process.loop.yaml"))
    moves = SetPoints.load(find_config("siso.set_points.yaml"), plant.outputs)
    controller = MpcController(SETTINGS.design(process), mode, [HeStiction(5.0, 2.0)])
    controller.start(plant.stem_start, plant.pv_start)
    applied = plant.stem_start

    def step(measured, sp):  # type: ignore[no-untyped-def]
        nonlocal applied
        applied = controller.step(measured.pv, sp, measured.dv, applied).op
        return applied

    record = simulate_closed_loop(plant, step, moves, samples, seed=1).record
    return float(np.abs(record.sp - record.pv).mean())


def main(samples: int = 2000) -> None:
    """Print the error under three formulations."""
    for mode in (ControlMode.UNAWARE, ControlMode.INVERSION, ControlMode.EMBEDDING):
        print(f"{mode:10} mean |error| {run(mode, samples):.3f}")


if __name__ == "__main__":
    main()
