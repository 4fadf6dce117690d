"""What a move of the stem buys: IAE against moves, over controllers and the worth of a move."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from stiction_ros.control import ControlMode, FrictionSpread, MpcController
from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import Measurement, SetPoints, simulate_closed_loop
from stiction_ros.online.session import Scenario
from stiction_ros.records.valve_work import ValveWork, largest_op_step
from stiction_ros.signals.holds import holds
from stiction_studies.examples.control_study import FIRST_HOLD, MOVES, held_out_set_points

HOLD = 120  # samples between two moves of the set-points that are drawn
SETTLED = 50  # last samples of a hold, whose mean error is its offset
CHEAP = 0.003  # S of the sticky valve where a jump costs next to nothing
KNOWN = FrictionSpread(0.0, 0.0)  # all controllers know the true friction


@dataclasses.dataclass(frozen=True)
class Candidate:
    """One controller.

    Attributes:
        name: for people.
        mode: of the controller.
        sticky: whether the valves of the plant stick.
        settings: in place of the scenario's.
    """

    name: str
    mode: ControlMode
    sticky: bool = True
    settings: Mapping[str, object] = dataclasses.field(default_factory=dict)


FREE = Candidate("no friction", ControlMode.UNAWARE, sticky=False)
UNAWARE = Candidate("SU", ControlMode.UNAWARE)
PRINTED = (
    Candidate("SI printed", ControlMode.INVERSION, settings={"formulation": "printed"}),
    Candidate("SE printed", ControlMode.EMBEDDING, settings={"formulation": "printed"}),
)
EXACT = Candidate("SE exact", ControlMode.EMBEDDING)


def priced(scenario: Scenario, factors: Sequence[float]) -> tuple[Candidate, ...]:
    """Return the exact embedding with the scenario's worth of a move times each factor."""
    worth = np.array(scenario.controller.move_worth)
    return tuple(
        dataclasses.replace(
            EXACT,
            name=f"SE exact, worth × {factor:g}",
            settings={"move_worth": tuple((factor * worth).tolist())},
        )
        for factor in factors
    )


def without(scenario: Scenario) -> tuple[Candidate, ...]:
    """Return the exact embedding without one part of what spares the valve, and without all."""
    others = scenario.controller.embedding_move_weights[1:]
    cheap: dict[str, object] = {"move_worth": (0.0,), "embedding_move_weights": (CHEAP, *others)}
    parts: dict[str, dict[str, object]] = {
        "no look-ahead": {"look_ahead": 0},
        "no limit of a kick": {"kick_limits": (float("inf"),)},
        "jumps cost nothing": cheap,
        "a price a jump, any size": {**cheap, "jump_price": 1.0},
        "none of it": {**cheap, "look_ahead": 0, "kick_limits": (float("inf"),)},
    }
    return tuple(
        dataclasses.replace(EXACT, name=f"SE exact, {name}", settings=changes)
        for name, changes in parts.items()
    )


@dataclasses.dataclass(frozen=True)
class WearScore:
    """One run; outputs without noise.

    Attributes:
        iae: ∫|PV − SP| dt, PV units × h, shape (p,).
        offset: mean |mean error| at the end of the holds, shape (p,).
        travel, moves, reversals: of the sticky stems together, travel in %.
        op_step: largest move of their OP from one sample to the next, %.
    """

    iae: FloatArray
    offset: FloatArray
    travel: float
    moves: float
    reversals: float
    op_step: float


def run_candidates(
    scenario: Scenario, candidates: Sequence[Candidate], seed: int
) -> list[WearScore]:
    """Run every candidate with the same noise and the same set-points.

    A scenario of two outputs gets set-points that are drawn for the seed, any other one round
    of its own.
    """
    return [_run(scenario, candidate, seed) for candidate in candidates]


def mean_score(scores: Sequence[WearScore]) -> WearScore:
    """Return the means over seeds, and the largest of the steps of OP."""
    keys = [field.name for field in dataclasses.fields(WearScore)]
    means = {key: np.mean([getattr(one, key) for one in scores], axis=0) for key in keys}
    means["op_step"] = max(one.op_step for one in scores)
    return WearScore(**means)


def _run(scenario: Scenario, candidate: Candidate, seed: int) -> WearScore:
    plant, sample_time = scenario.plant, scenario.plant.sample_time
    laws = [
        next((effect for effect in valve.effects if isinstance(effect, HeStiction)), None)
        for valve in plant.valves
    ]
    settings = dataclasses.replace(scenario.controller, **candidate.settings)  # type: ignore[arg-type]
    controller = MpcController(
        settings.design(scenario.process),
        candidate.mode,
        laws,
        [None if law is None else KNOWN for law in laws],
    )
    sticky = [j for j, law in enumerate(laws) if law is not None]
    if not candidate.sticky:
        plant = plant.with_ideal_valves()
    schedule, samples = schedule_of(scenario, seed)
    applied = plant.stem_start

    def control(measurement: Measurement, sp: FloatArray) -> FloatArray:
        nonlocal applied
        applied = controller.step(measurement.pv, sp, measurement.dv, applied).op
        return applied

    run = simulate_closed_loop(plant, control, schedule, samples, seed)
    record = run.record
    assert record.sp is not None
    assert record.stem is not None
    error = run.pv_clean - record.sp
    ends = [b for a, b in holds(record.sp) if b - a >= 2 * SETTLED]
    work = [ValveWork.of(record.stem[:, j]) for j in sticky]
    steps = list(largest_op_step(record).values())
    return WearScore(
        np.abs(error).sum(axis=0) * sample_time / 3600.0,
        np.mean([np.abs(error[b - SETTLED : b].mean(axis=0)) for b in ends], axis=0),
        sum(one.travel for one in work),
        sum(one.moves for one in work),
        sum(one.reversals for one in work),
        max(steps[j] for j in sticky),
    )


def schedule_of(scenario: Scenario, seed: int) -> tuple[SetPoints, int]:
    """Return the set-points of one run and its length in samples."""
    sample_time = scenario.plant.sample_time
    if len(scenario.process.outputs) != 2:
        return scenario.set_points, round(scenario.set_points.repeat / sample_time)
    start = scenario.set_points.values[0]
    drawn = held_out_set_points(scenario.process.outputs, start, sample_time, HOLD, seed)
    return drawn, FIRST_HOLD + MOVES * HOLD
