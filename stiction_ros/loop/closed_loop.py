"""A whole closed loop as one function: no ROS, seeded, repeatable bit for bit."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop.model import LoopModel, PiTuning
from stiction_ros.loop.plant import Measurement, Plant
from stiction_ros.loop.set_points import SetPoints
from stiction_ros.loop.valve_changes import ValveChange
from stiction_ros.records import Record


class Controller(Protocol):
    """Anything that turns a measurement and set-points into controller outputs."""

    def __call__(self, measurement: Measurement, sp: FloatArray) -> FloatArray:
        """Return OP, shape (m,), %, for PV and set-points, shape (p,) each."""
        ...


@dataclasses.dataclass(frozen=True)
class ClosedLoopRun:
    """Signals of a simulated loop.

    Attributes:
        record: op, pv, sp and the true stem positions.
        pv_clean: outputs without noise, shape (N, p).
    """

    record: Record
    pv_clean: FloatArray


def simulate_closed_loop(
    model: LoopModel,
    controller: Controller,
    set_points: SetPoints,
    samples: int,
    seed: int,
    progress: Callable[[int], None] | None = None,
    valve_changes: Sequence[ValveChange] = (),
) -> ClosedLoopRun:
    """Run ``controller`` on the plant of ``model`` for ``samples`` samples.

    Args:
        model: plant, sample time and starting point.
        controller: called once per sample, in order.
        set_points: schedule, in seconds.
        samples: number N of samples.
        seed: of the plant's noise.
        progress: called with the number of samples done, about a hundred times.
        valve_changes: valves that change in mid-run, in the order of their times.
    """
    plant = Plant(model, seed, valve_changes)
    m, p = len(model.valves), len(model.outputs)
    op, stem = np.empty((samples, m)), np.empty((samples, m))
    pv, sp, clean = (np.empty((samples, p)) for _ in range(3))
    every = max(samples // 100, 1)
    for k in range(samples):
        measurement = plant.measure()
        pv[k], clean[k] = measurement.pv, measurement.pv_clean
        sp[k] = set_points.at(measurement.time)
        op[k] = controller(measurement, sp[k])
        stem[k] = plant.apply(op[k])
        if progress is not None and k % every == 0:
            progress(k)
    record = Record(
        model.name, model.sample_time, model.valve_names, model.outputs, op, pv, sp, stem
    )
    return ClosedLoopRun(record, clean)


class PiController:
    """Velocity-form PI: u_k = u_{k−1} + K[(e_k − e_{k−1}) + (T_s/T_i) e_k], e = SP − PV.

    One valve, one output; K is signed; OP is clipped to the limits.
    """

    def __init__(
        self, tuning: PiTuning, sample_time: float, op: float, limits: tuple[float, float]
    ) -> None:
        """Start from ``op`` with no error."""
        self.tuning = tuning
        self.sample_time = sample_time
        self.limits = limits
        self._op = op
        self._error: float | None = None

    def __call__(self, measurement: Measurement, sp: FloatArray) -> FloatArray:
        error = float(sp[0] - measurement.pv[0])
        before = error if self._error is None else self._error
        share = self.sample_time / self.tuning.integral_time
        op = self._op + self.tuning.gain * (error - before + share * error)
        self._op = min(max(op, self.limits[0]), self.limits[1])
        self._error = error
        return np.array([self._op])
