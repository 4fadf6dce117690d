"""What would help the loop of a loop model, simulated under its own controller as baseline."""

import dataclasses
from collections.abc import Callable

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.effects.friction.stiction import FrictionPair, SlipJumpPair
from stiction_ros.errors import InputError
from stiction_ros.gain.embedding import EmbeddingDesign, EmbeddingRun
from stiction_ros.gain.gain import Gain, Option, What, option_of
from stiction_ros.gain.measures import Measures, Yardstick, cycle_period
from stiction_ros.gain.retuning import SHIFTS, Tuning, calm, most_helpful, peak
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
# runs of a model under controllers made anew, its own where none is given: measures by seed
Runs = Callable[[LoopModel, Callable[[], Controller] | None], list[Measures | None]]


def gain_of_model(
    model: LoopModel, set_points: SetPoints | None = None, samples: int = SAMPLES
) -> Gain:
    """Simulate what would help the loop of a model.

    Args:
        model: with a controller.
        set_points: None moves the set-point once, by what shows the friction.
        samples: of a run.

    Raises:
        InputError: no controller, more than one valve or output, or a loop that grows without end.
    """
    own_controller(model)  # refuses
    friction = next((e for e in model.valves[0].effects if isinstance(e, Friction)), None)
    band = 0.0 if friction is None else friction.static_friction + friction.dynamic_friction
    last = model.process.linear(model.sample_time).step_responses(101)[-1, 0, 0]
    push = float(last) * max(PUSHED * band, LEAST_PUSH)  # of PV, by a move of some bands
    if set_points is None:
        times, start = np.array([0.0, 20.0 * model.sample_time]), float(model.pv0[0])
        set_points = SetPoints(model.outputs, times, np.array([[start], [start + push]]))

    def recorded(changed: LoopModel, seed: int, control: Controller) -> Record:
        return simulate_closed_loop(changed, control, set_points, samples, seed).record

    first = recorded(model, SEEDS[0], own_controller(model))
    assert first.sp is not None
    stretches = holds(first.sp)
    period = cycle_period(oscillation((first.pv - first.sp)[:, 0], stretches))
    yardstick = Yardstick(model.sample_time, period is not None, stretches)

    def runs(
        changed: LoopModel, control: Callable[[], Controller] | None = None
    ) -> list[Measures | None]:
        found = []
        for seed in SEEDS:
            run = recorded(changed, seed, control() if control else own_controller(changed))
            assert run.sp is not None
            assert run.stem is not None
            found.append(yardstick.measured((run.pv - run.sp)[:, 0], run.stem[:, 0]))
        return found

    left = option_of(What.LEAVE, runs(model), "The loop as it is, simulated.")
    if left.measures is None:
        raise InputError("the loop grows without end under its own controller", where=model.name)
    note = "The valve without friction under the controller that is there."
    service = option_of(What.SERVICE, runs(model.with_ideal_valves()), note)
    tried = {one: runs(_tuned(model, one)) for one in calm(friction is not None, _peak_of(model))}
    best = most_helpful(tried)
    options = (
        service,
        _embedding(model, friction, push, runs),
        option_of(What.RETUNE, tried[best], best.note, best.settings),
        left,
    )
    return Gain(model.valve_names[0], model.outputs[0], left.measures, options)


def _tuned(model: LoopModel, tuning: Tuning) -> LoopModel:
    """Return the model with factors on the tuning of its controller."""
    own = own_controller(model).tuning
    changed = PiTuning(own.gain * tuning.gain, own.integral_time * tuning.integral_time)
    return dataclasses.replace(model, controller=changed)


def _peak_of(model: LoopModel) -> Callable[[Tuning], float]:
    """Return what gives the peak of the sensitivity of the loop without friction."""
    linear = model.process.linear(model.sample_time)
    eye = np.eye(linear.order)
    plant = [linear.c[0] @ np.linalg.solve(eye / q - linear.a, linear.b[:, 0]) for q in SHIFTS]

    def peak_of(tuning: Tuning) -> float:
        own = own_controller(_tuned(model, tuning)).tuning
        control = own.gain * (1.0 + model.sample_time / own.integral_time / (1.0 - SHIFTS))
        return peak(np.asarray(control * np.array(plant)))

    return peak_of


def _embedding(model: LoopModel, friction: Friction | None, push: float, runs: Runs) -> Option:
    if friction is None or friction.static_friction <= 0.0:
        return Option(What.EMBEDDING, None, {}, "The valve follows no law of stiction.")
    noise = float(np.max([model.process.noise_std(entry).max() for entry in NoiseEntry]))
    noise = max(noise, QUIET * abs(push)) ** 2

    def control() -> Controller:
        run, op = EmbeddingRun(design, np.empty(0), np.empty(0)), np.array(model.stem_start)

        def answer(measurement: Measurement, sp: FloatArray) -> FloatArray:
            op[0] = run(float(measurement.pv[0]), float(sp[0]), float(op[0]))
            return op.copy()

        return answer

    try:
        known = model.with_ideal_valves()
        design = EmbeddingDesign.by_rule(known, friction, None, (noise, 1e-2 * noise))
        found = runs(model, control)
    except InputError as error:
        return Option(What.EMBEDDING, None, {}, f"It cannot be set up: {error}.")
    note = "Predictive control that knows the friction."
    return option_of(What.EMBEDDING, found, note, design.weights())
