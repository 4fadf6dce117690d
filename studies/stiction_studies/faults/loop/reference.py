"""How far OP may move in one sample: what it does when nothing is wrong.

The same loop, seed and prepared model without ROS, which in lockstep gives the numbers of the
graph bit for bit, over two rounds of the set-point schedule. Before the swap a case is held
against the unaware controller, afterwards against the run with the swap in it.
"""

import dataclasses
import functools

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import Measurement, simulate_closed_loop
from stiction_ros.online.controller.live import LiveController
from stiction_studies.faults.loop.setting_up import HAND_OVER, NEVER, WARM_UP, scenario
from stiction_studies.faults.terms import Phase

SAMPLES = 2600  # a whole round of the schedule and the move that begins the next
SLACK = 1.1  # times the largest move without faults


class _Reference:
    """The controller of the suite, which is offered the friction once."""

    def __init__(self, phase: Phase) -> None:
        found = scenario()
        settings = dataclasses.replace(
            found.controller, hand_over_samples=HAND_OVER, fit_first=NEVER
        )
        self._live = LiveController(settings, found.process)
        self._offer = found.plant if phase is Phase.AFTER else None
        self._sample = 0

    def __call__(self, measurement: Measurement, sp: FloatArray) -> FloatArray:
        if self._offer is not None and self._sample == HAND_OVER + WARM_UP:
            self._live.offer(self._offer, self._sample)
        self._sample += 1
        return np.asarray(self._live.step(measurement.pv, sp, measurement.dv).op)


@functools.cache
def allowed_move(phase: Phase, seed: int) -> float:
    """Return the largest move of OP in a sample that a case may show, %.

    Args:
        phase: of the case.
        seed: of the plant's noise.
    """
    found = scenario()
    limits = np.asarray(found.controller.op_rate_limits, dtype=float)
    if np.isfinite(limits).all():
        return float(limits.max())
    return SLACK * float(np.abs(np.diff(ops_without_fault(phase, seed), axis=0)).max())


def ops_without_fault(phase: Phase, seed: int, samples: int = SAMPLES) -> list[tuple[float, ...]]:
    """Return OP in force at each sample of the run without faults, that of the start first, %.

    Args:
        phase, seed: as :func:`allowed_move`.
        samples: of the run.
    """
    found = scenario()
    run = simulate_closed_loop(found.plant, _Reference(phase), found.set_points, samples, seed)
    return [tuple(row) for row in [list(found.plant.stem_start), *run.record.op.tolist()]]
