"""A whole closed loop as one function: no ROS, seeded, repeatable bit for bit."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.checks import of_kind
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop.model import LoopModel, PiTuning
from stiction_ros.loop.plant import Measurement, Plant
from stiction_ros.loop.set_points import SetPoints
from stiction_ros.loop.valve_changes import ValveChange
from stiction_ros.records import Record

# gives OP, shape (m,), %, for a measurement and set-points, shape (p,)
Controller = Callable[[Measurement, FloatArray], FloatArray]


@dataclasses.dataclass(frozen=True)
class ClosedLoopRun:
    """Signals of a simulated loop."""

    record: Record  # op, pv, sp and the true stem positions
    pv_clean: FloatArray = dataclasses.field(repr=False)  # outputs without noise, shape (N, p)


def simulate_closed_loop(
    model: LoopModel,
    controller: Controller,
    set_points: SetPoints | None,
    samples: int,
    seed: int,
    progress: Callable[[int], None] | None = None,
    valve_changes: Sequence[ValveChange] = (),
) -> ClosedLoopRun:
    """Run ``controller`` on the plant of ``model`` for ``samples`` samples.

    Args:
        model: plant, sample time and starting point.
        controller: called once per sample, in order.
        set_points: schedule, in seconds; None where there are none, as in manual.
        samples: number N of samples.
        seed: of the plant's noise.
        progress: called with the number of samples done, about a hundred times.
        valve_changes: valves that change in mid-run, in the order of their times.

    Raises:
        InputError: a signal that grows without bound.

    Returns:
        The record with the true stems (%), and the outputs without noise.

    Examples:
        >>> import numpy as np
        >>> from stiction_ros import LoopModel, SetPoints, find_config, simulate_closed_loop
        >>> model = LoopModel.load(find_config("flow.loop.yaml"))
        >>> schedule = SetPoints.load(find_config("flow.set_points.yaml"), model.outputs)
        >>> by_hand = lambda measured, sp: np.array([50.0 + 0.5 * (sp[0] - measured.pv[0])])
        >>> run = simulate_closed_loop(model, by_hand, schedule, samples=30, seed=1)
        >>> run.record.op.shape
        (30, 1)
    """
    plant = Plant(model, seed, valve_changes)
    m, p = len(model.valves), len(model.outputs)
    op, stem = np.empty((samples, m)), np.empty((samples, m))
    pv, sp, clean = (np.empty((samples, p)) for _ in range(3))
    every = max(samples // 100, 1)
    for k in range(samples):
        measurement = plant.measure()
        pv[k], clean[k] = measurement.pv, measurement.pv_clean
        sp[k] = np.nan if set_points is None else set_points.at(measurement.time)
        op[k] = controller(measurement, sp[k])
        stem[k] = plant.apply(op[k])
        if progress is not None and k % every == 0:
            progress(k)
    tags = model.name, model.sample_time, model.valve_names, model.outputs
    record = Record(*tags, op, pv, None if set_points is None else sp, stem)
    return ClosedLoopRun(record, clean)


class PiController:
    """Velocity-form PI: u_k = u_{k−1} + K[(e_k − e_{k−1}) + (T_s/T_i) e_k], e = SP − PV.

    One valve, one output; K is signed; OP is clipped to the limits.
    """

    def __init__(
        self, tuning: PiTuning, sample_time: float, op: float, limits: tuple[float, float]
    ) -> None:
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


def own_controller(model: LoopModel) -> PiController:
    """Return the controller that ``model`` records, at rest at the loop's starting point."""
    if model.controller is None:
        raise InputError(
            "the loop has no controller of its own",
            where=model.name,
            fix="add controller: {kind: pi, gain: 0.5, integral_time: 20.0} to the loop model",
        )
    if (len(model.valves), len(model.outputs)) != (1, 1):
        raise InputError(
            f"a pi controller serves one valve and one output, not {len(model.valves)} "
            f"and {len(model.outputs)}",
            where=f"{model.name}: controller",
            fix="run it under predictive control: stiction demo",
        )
    low, high = (float(limit) for limit in model.limits[0])
    op = float(model.stem_start[0])
    return PiController(model.controller, model.sample_time, op, (low, high))


def simulate(
    model: LoopModel,
    set_points: SetPoints | None = None,
    samples: int = 2000,
    seed: int = 1,
    progress: Callable[[int], None] | None = None,
) -> Record:
    """Return the record of a loop under its own controller, stems included.

    Every sample the controller of ``model`` takes PV and gives OP, and the plant answers by
    equations (1) and (2); the same model and seed give the same record, bit for bit.

    Args:
        model: plant and controller (``controller:`` of the loop model, a PI).
        set_points: schedule in seconds; None holds the operating point.
        samples: N ≥ 2.
        seed: of the plant's noise, 0 up.
        progress: called with the number of samples done, about a hundred times.

    Returns:
        OP and stem in %, shape (N, 1); PV and SP in engineering units, shape (N, 1).

    Raises:
        InputError: no controller, or one that does not fit the loop; a schedule of other
            outputs; a number out of range.

    Examples:
        >>> from stiction_ros import LoopModel, find_config, simulate
        >>> record = simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=300)
        >>> len(record), record.valves, record.outputs
        (300, ('V1',), ('PV1',))
        >>> bool((record.op[:, 0] != record.stem[:, 0]).any())
        True
    """
    of_kind(model, LoopModel, "model", "give LoopModel.load(path)")
    controller = own_controller(model)
    if set_points is None:
        set_points = SetPoints(model.outputs, np.zeros(1), model.pv0[None, :])
    if set_points.outputs != model.outputs:
        raise InputError(
            f"set-points are of {', '.join(set_points.outputs)}",
            where=model.name,
            fix=f"use {', '.join(model.outputs)}",
        )
    if samples < 2:
        raise InputError(f"{samples} is too few", where="samples", fix="use 2 or more")
    if seed < 0:
        raise InputError(f"{seed} is negative", where="seed", fix="use 0 or more")
    return simulate_closed_loop(model, controller, set_points, samples, seed, progress).record
