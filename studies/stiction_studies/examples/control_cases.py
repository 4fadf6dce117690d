"""The tank of Example 2 under the exact embedding, held against the loop without stiction."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from stiction_ros.config_files import find_config
from stiction_ros.control.embedding import EmbeddingMpc
from stiction_ros.effects import Behaviour, HeStiction, StepDisturbance
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import ClosedLoopRun, LoopModel, Measurement, SetPoints, simulate_closed_loop
from stiction_ros.online.controller.live import LiveController
from stiction_ros.online.session import Scenario
from stiction_ros.records.valve_work import ValveWork, largest_op_step
from stiction_ros.signals.holds import holds

SAMPLES = 640
OFFSET_SAMPLES = 50
LATE_SAMPLES = 60  # end of every hold in which a valve that still turns is cycling

TANK = "tank.scenario.yaml"

TRUE = {"V1": HeStiction(8.0, 1.0)}
SECOND = {**TRUE, "V2": HeStiction(5.0, 1.0)}


@dataclasses.dataclass(frozen=True)
class ControlCase:
    """One way in which the loop may differ from what its controller knows.

    Attributes:
        name: of the case.
        limit: largest ratio of IAE to the stiction-free loop that is asked for, or None.
        true, known: friction by valve, of the plant and of the controller.
        upset: a step on a further input of the tank: its name, time in s, and size.
        own_weights: compare with a stiction-free loop under the embedding's own weights.
        settings: of the controller, in place of the scenario's.
    """

    name: str
    limit: float | None
    true: Mapping[str, Behaviour]
    known: Mapping[str, Behaviour]
    upset: tuple[str, float, float] | None = None
    own_weights: bool = False
    settings: Mapping[str, object] = dataclasses.field(default_factory=dict)


def _scaled(static: float, dynamic: float) -> dict[str, Behaviour]:
    return {"V1": HeStiction(8.0 * static, 1.0 * dynamic)}


CASES: Mapping[str, ControlCase] = {
    case.name: case
    for case in (
        ControlCase("nominal", 1.15, TRUE, TRUE),
        ControlCase("own_weights", 1.45, TRUE, TRUE, own_weights=True),
        ControlCase("both_20_low", 1.35, TRUE, _scaled(0.8, 0.8)),
        ControlCase("both_20_high", 1.35, TRUE, _scaled(1.2, 1.2)),
        ControlCase("low_and_high", 1.35, TRUE, _scaled(0.8, 1.2)),
        ControlCase("high_and_low", 1.35, TRUE, _scaled(1.2, 0.8)),
        ControlCase("true_50_more", 2.0, _scaled(1.5, 1.0), TRUE),
        ControlCase("known_50_more", 2.0, TRUE, _scaled(1.5, 1.0)),
        ControlCase("C_B", None, TRUE, TRUE, ("C_B", 12000.0, 0.15)),
        ControlCase("T_A", None, TRUE, TRUE, ("T_A", 12000.0, 2.0)),
        ControlCase("F_B", None, TRUE, TRUE, ("F_B", 12000.0, 0.03)),
        # An offset of T is mended by valve 2 alone: dearer jumps leave more than 0.02 °C.
        ControlCase("two_valves", None, SECOND, SECOND, settings={"move_worth": (0.022, 0.007)}),
    )
}


@dataclasses.dataclass(frozen=True)
class ControlOutcome:
    """Scores of one run on noise-free outputs, each of shape (p,).

    Attributes:
        iae: mean |PV − SP|.
        offset: mean over the holds of |mean PV − SP| over their last 50 samples.
        late_turns: most turns of one stem in the last 60 samples of a hold; a cycle
            that goes on has several.
        travel, moves, reversals: of the sticky stems together, %; of valve 1 where none sticks.
        op_step: largest move of an OP of theirs from one sample to the next, %.
        error: noise-free PV − SP, shape (N, p).
        sp: set-points, shape (N, p).
    """

    iae: FloatArray
    offset: FloatArray
    late_turns: int
    travel: float
    moves: float
    reversals: float
    op_step: float
    error: FloatArray
    sp: FloatArray


def run_unaware(case: ControlCase, seed: int) -> ControlOutcome:
    """Run the controller that does not know of the friction on the plant of ``case``."""
    scenario = Scenario.load(find_config(TANK))
    true = {k: [v] for k, v in case.true.items()}
    return _run(case, scenario, scenario.process, true, seed, {"mode": "unaware"})


def run_case(
    case: ControlCase, seed: int, settings: Mapping[str, object] | None = None
) -> ControlOutcome:
    """Run the exact embedding on the plant of ``case``.

    Args:
        case: the case.
        seed: of the noise.
        settings: changes to the scenario's controller settings.
    """
    scenario = Scenario.load(find_config(TANK))
    model = scenario.process.with_valve_effects({k: [v] for k, v in case.known.items()})
    true = {k: [v] for k, v in case.true.items()}
    return _run(case, scenario, model, true, seed, {**case.settings, **(settings or {})})


def run_reference(case: ControlCase, seed: int) -> ControlOutcome:
    """Run the unaware controller on the plant of ``case`` with ideal valves."""
    scenario = Scenario.load(find_config(TANK))
    settings: dict[str, object] = {"mode": "unaware"}
    if case.own_weights:
        laws = tuple(case.known.get(name) for name in scenario.process.valve_names)
        design = scenario.controller.design(scenario.process)
        own = EmbeddingMpc(design.model, design.embedding, design.limits, laws, design.jumps)
        settings["move_weights"] = tuple(np.diag(own.move_weights).tolist())
    return _run(case, scenario, scenario.process, {}, seed, settings)


def _run(
    case: ControlCase,
    scenario: Scenario,
    known: LoopModel,
    true: Mapping[str, list[Behaviour]],
    seed: int,
    settings: Mapping[str, object],
) -> ControlOutcome:
    plant = scenario.plant.with_ideal_valves().with_valve_effects(true)
    if case.upset is not None:
        plant = _upset(plant, case.upset)
    chosen = dataclasses.replace(scenario.controller, **settings)  # type: ignore[arg-type]
    live = LiveController(chosen, known)

    def act(measurement: Measurement, sp: FloatArray) -> FloatArray:
        return live.step(measurement.pv, sp, measurement.dv).op

    set_points = SetPoints.load(find_config("tank_held_out.set_points.yaml"), plant.outputs)
    run = simulate_closed_loop(plant, act, set_points, SAMPLES, seed)
    return _scores(run, len(true))


def _upset(plant: LoopModel, upset: tuple[str, float, float]) -> LoopModel:
    name, time, size = upset
    if name not in plant.process.upsets:
        raise InputError(f"the tank has no input {name!r}", where="upset")
    document = plant.to_mapping()
    step = StepDisturbance(time, size).to_mapping()
    document["disturbances"] = [{"input": name, **step}]
    return LoopModel.from_mapping(document, plant.name)


def _scores(run: ClosedLoopRun, sticky: int) -> ControlOutcome:
    sp, stem = run.record.sp, run.record.stem
    assert sp is not None
    assert stem is not None
    error = run.pv_clean - sp
    ends = [b for a, b in holds(sp) if b - a >= 2 * OFFSET_SAMPLES]
    offset = np.mean([np.abs(error[b - OFFSET_SAMPLES : b].mean(axis=0)) for b in ends], axis=0)
    counted = max(sticky, 1)
    work = [ValveWork.of(stem[:, j]) for j in range(counted)]
    turns = [_turns(stem[b - LATE_SAMPLES : b, j]) for b in ends for j in range(sticky)]
    return ControlOutcome(
        np.abs(error).mean(axis=0),
        np.asarray(offset),
        max(turns, default=0),
        sum(one.travel for one in work),
        sum(one.moves for one in work),
        sum(one.reversals for one in work),
        max(list(largest_op_step(run.record).values())[:counted]),
        error,
        sp,
    )


def _turns(stem: FloatArray) -> int:
    """Return how often the moves of ``stem``, shape (N,), change their direction."""
    return int(ValveWork.of(stem).reversals)
