"""What would help the loop of a loop model, simulated under its own controller as baseline."""

import dataclasses
from collections.abc import Callable

import numpy as np

from stiction_ros.control import MpcController
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.effects.friction.stiction import FrictionPair, SlipJumpPair
from stiction_ros.errors import InputError
from stiction_ros.gain.embedding import EmbeddingDesign
from stiction_ros.gain.gain import Gain, Option, What, option_of
from stiction_ros.gain.measures import Measures, Yardstick, cycle_period
from stiction_ros.gain.retuning import UNCHANGED, Tuning, calm, frequencies, most_helpful, peak
from stiction_ros.loop import LoopModel
from stiction_ros.loop.closed_loop import Controller, own_controller, simulate_closed_loop
from stiction_ros.loop.model import PiTuning
from stiction_ros.loop.plant import Measurement
from stiction_ros.loop.set_points import SetPoints
from stiction_ros.processes.process import NoiseEntry
from stiction_ros.records.record import Record
from stiction_ros.signals.holds import holds
from stiction_ros.signals.oscillation import oscillation

SAMPLES = 2000
"""Samples that are simulated."""

SEEDS = (1, 2, 3)
"""Of the noise; a model is taken as it is, so nothing else is drawn."""

PUSHED = 2.0
"""Bands of friction by which the set-point moves at the start: a loop at rest shows no cycle."""

LEAST_PUSH = 1.0
"""%: the same where there is no friction."""

QUIET = 0.02
"""Noise of a model without any, in what a push makes of PV."""


Friction = FrictionPair | SlipJumpPair


@dataclasses.dataclass(frozen=True)
class ModelLoop:
    """One valve, one output, one PI controller, ready to be simulated."""

    model: LoopModel  # as given
    tuning: PiTuning  # of its controller
    friction: Friction | None  # law of its valve; None without one
    set_points: SetPoints  # schedule
    samples: int  # of a run

    @classmethod
    def of(
        cls, model: LoopModel, set_points: SetPoints | None = None, samples: int = SAMPLES
    ) -> "ModelLoop":
        """Return the loop of a model.

        Args:
            model: with a controller.
            set_points: None moves the set-point once, by what shows the friction.
            samples: of a run.

        Raises:
            InputError: no controller, or more than one valve or output.
        """
        tuning = own_controller(model).tuning
        laws = [effect for effect in model.valves[0].effects if isinstance(effect, Friction)]
        friction = laws[0] if laws else None
        push = _push(model, friction)
        if set_points is None:
            start = float(model.pv0[0])
            moves = np.array([[start], [start + push]])
            set_points = SetPoints(model.outputs, np.array([0.0, 20.0 * model.sample_time]), moves)
        return cls(model, tuning, friction, set_points, samples)

    def run(self, model: LoopModel, control: Callable[[], Controller]) -> list[Record]:
        """Return one run for each seed, each under a new controller."""
        return [
            simulate_closed_loop(model, control(), self.set_points, self.samples, seed).record
            for seed in SEEDS
        ]

    def pi(self, tuning: Tuning = UNCHANGED) -> Callable[[], Controller]:
        """Return what makes the PI controller with factors on its tuning."""
        changed = PiTuning(
            self.tuning.gain * tuning.gain, self.tuning.integral_time * tuning.integral_time
        )
        model = dataclasses.replace(self.model, controller=changed)
        return lambda: own_controller(model)

    def sensitivity(self, tuning: Tuning) -> float:
        """Return the peak of the sensitivity of the loop without friction."""
        linear = self.model.process.linear(self.model.sample_time)
        turn = frequencies()
        gain = self.tuning.gain * tuning.gain
        time = self.tuning.integral_time * tuning.integral_time
        control = gain * (1.0 + self.model.sample_time / time / (1.0 - turn))
        eye = np.eye(linear.order)
        plant = [linear.c[0] @ np.linalg.solve(eye / q - linear.a, linear.b[:, 0]) for q in turn]
        return peak(np.asarray(control * np.array(plant)))


def gain_of_model(
    model: LoopModel, set_points: SetPoints | None = None, samples: int = SAMPLES
) -> Gain:
    """Simulate what would help the loop of a model; see :meth:`ModelLoop.of`."""
    loop = ModelLoop.of(model, set_points, samples)
    first = loop.run(model, loop.pi())
    assert first[0].sp is not None
    stretches = holds(first[0].sp)
    period = cycle_period(oscillation((first[0].pv - first[0].sp)[:, 0], stretches))
    yardstick = Yardstick(model.sample_time, period is not None, stretches)

    def measured(runs: list[Record]) -> list[Measures | None]:
        found = []
        for run in runs:
            assert run.sp is not None
            assert run.stem is not None
            found.append(yardstick.measured((run.pv - run.sp)[:, 0], run.stem[:, 0]))
        return found

    left = option_of(What.LEAVE, measured(first), "The loop as it is, simulated.")
    if left.measures is None:
        raise InputError("the loop grows without end under its own controller", where=model.name)
    service = option_of(
        What.SERVICE,
        measured(loop.run(model.with_ideal_valves(), loop.pi())),
        "The valve without friction under the controller that is there.",
    )
    return Gain(
        model.valve_names[0],
        model.outputs[0],
        left.measures,
        (service, _embedding(loop, measured), _retune(loop, measured), left),
    )


Measured = Callable[[list[Record]], list[Measures | None]]


def _retune(loop: ModelLoop, measured: Measured) -> Option:
    runs = {
        tuning: measured(loop.run(loop.model, loop.pi(tuning)))
        for tuning in calm(loop.friction is not None, loop.sensitivity)
    }
    best = most_helpful(runs)
    return option_of(What.RETUNE, runs[best], best.note, best.settings)


def _embedding(loop: ModelLoop, measured: Measured) -> Option:
    if loop.friction is None or loop.friction.static_friction <= 0.0:
        return Option(What.EMBEDDING, None, {}, "The valve follows no law of stiction.")
    model = loop.model.with_ideal_valves()
    noise = float(np.max([model.process.noise_std(entry).max() for entry in NoiseEntry]))
    noise = max(noise, QUIET * abs(_push(model, loop.friction))) ** 2
    try:
        design = EmbeddingDesign.by_rule(model, loop.friction, None, (noise, 1e-2 * noise))
        runs = loop.run(loop.model, lambda: _Mpc(design.controller(), model.stem_start))
    except InputError as error:
        return Option(What.EMBEDDING, None, {}, f"It cannot be set up: {error}.")
    note = "Predictive control that knows the friction."
    return option_of(What.EMBEDDING, measured(runs), note, design.weights())


class _Mpc:
    """A predictive controller that answers like the others."""

    def __init__(self, controller: MpcController, op: FloatArray) -> None:
        self._controller, self._op = controller, np.array(op, dtype=float)
        self._dv = np.zeros(controller.design.model.e.shape[1])

    def __call__(self, measurement: Measurement, sp: FloatArray) -> FloatArray:
        self._op = self._controller.step(measurement.pv, sp, self._dv, self._op).op
        return self._op


def _push(model: LoopModel, friction: Friction | None) -> float:
    """Return by how much PV moves when the stem moves by some bands, within a hundred samples."""
    band = 0.0 if friction is None else friction.static_friction + friction.dynamic_friction
    last = model.process.linear(model.sample_time).step_responses(101)[-1, 0, 0]
    return float(last) * max(PUSHED * band, LEAST_PUSH)
