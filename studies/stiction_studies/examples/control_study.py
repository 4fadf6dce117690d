"""Example 2 under the paper's three controllers, the exact embedding, and without friction."""

import dataclasses
from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from stiction_ros.config_files import find_config
from stiction_ros.control import ControlMode, FrictionSpread, MpcController, StepResult
from stiction_ros.effects import HeStiction, Stiction
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.friction import behaviour_of
from stiction_ros.loop import ClosedLoopRun, LoopModel, Measurement, SetPoints, simulate_closed_loop
from stiction_ros.online.session import Scenario
from stiction_ros.paper.controllers.embedding import PrintedPlan
from stiction_ros.paper.controllers.weights import ProgrammeCost, WarmStart, WeightPreset
from stiction_studies.examples.paper import PLANTS

SCHEDULES = ("held-out", "scenario")
LAWS = ("he", "kano", "xch")
FIRST_HOLD = 20  # samples at the operating point
MOVES = 5
# Held-out set-points lie this far from the operating point at most; valves then stay well
# inside their limits. A move is at least a fifth of it.
REACH = (0.25, 3.0)


@dataclasses.dataclass(frozen=True)
class Column:
    """One controller of the comparison.

    Attributes:
        key: in JSON.
        short, title: for people.
        mode: of the controller.
        printed: whether embedding and inversion are the paper's own.
        sticky: whether the valves of the plant stick.
    """

    key: str
    short: str
    title: str
    mode: ControlMode
    printed: bool = False
    sticky: bool = True


COLUMNS = (
    Column("unaware", "SU", "SU, unaware", ControlMode.UNAWARE),
    Column("inversion", "SI", "SI, inversion as printed", ControlMode.INVERSION, printed=True),
    Column(
        "printed", "SE printed", "SE, embedding as printed", ControlMode.EMBEDDING, printed=True
    ),
    Column("exact", "SE exact", "SE, exact embedding", ControlMode.EMBEDDING),
    Column("free", "no friction", "SU, valves without friction", ControlMode.UNAWARE, sticky=False),
)


@dataclasses.dataclass(frozen=True)
class StudyOptions:
    """What is compared.

    Attributes:
        plant: ``tank`` is the nonlinear tank (A.1), ``linear`` is (A.3).
        preset: weights of SU, SI and of the loop without friction; ``own`` are those of the
            scenario. The exact embedding always has those of the scenario.
        warm_start: of the embedding as printed.
        programme_cost: of the embedding as printed.
        law: of the sticky valves, and what the controllers take it for; with the frictions of the
            scenario.
        move_scale: of S of SU and SI, preset ``own``: 10 moves OP ten times as dear.
        known: (f_S, f_D) of every valve, %, as the controllers know them, (0, 0) for a healthy
            one; None for the truth.
        schedule: ``held-out`` draws set-points for each seed, ``scenario`` takes those of the
            scenario, on which its weights were chosen.
        hold: samples between set-point moves of ``held-out``.

    Raises:
        InputError: an unknown plant or schedule, or a hold too short to settle in.
    """

    plant: str = "tank"
    preset: WeightPreset = WeightPreset.OWN
    warm_start: WarmStart = WarmStart.COMPENSATION
    programme_cost: ProgrammeCost = ProgrammeCost.REVISED
    law: str = "he"
    move_scale: float = 1.0
    known: tuple[tuple[float, float], ...] | None = None
    schedule: str = "held-out"
    hold: int = 120

    def __post_init__(self) -> None:
        for value, known, where in (
            (self.plant, PLANTS, "plant"),
            (self.schedule, SCHEDULES, "schedule"),
            (self.law, LAWS, "law"),
        ):
            if value not in known:
                raise InputError(
                    f"unknown value {value!r}", where=where, fix=f"use {' or '.join(known)}"
                )
        if self.hold < 2 * FIRST_HOLD:
            raise InputError(
                f"{self.hold} samples are too short to settle in",
                where="hold",
                fix=f"use {2 * FIRST_HOLD} or more",
            )
        for static, dynamic in self.known or ():
            if not 0.0 <= dynamic <= static:
                raise InputError(
                    f"{static:g}, {dynamic:g} is no friction",
                    where="known",
                    fix="give f_S, f_D with 0 <= f_D <= f_S",
                )


@dataclasses.dataclass(frozen=True)
class ColumnRun:
    """One controller's run.

    Attributes:
        run: signals.
        times: of each step, ms.
        from_start: whether the warm start was applied, a step each; empty where there is none.
        statuses: how often each :class:`~stiction_ros.control.StepStatus` occurred.
    """

    run: ClosedLoopRun
    times: FloatArray
    from_start: tuple[bool, ...]
    statuses: Mapping[str, int]


@dataclasses.dataclass(frozen=True)
class Trial:
    """All controllers on one plant with one seed, in the order of :data:`COLUMNS`.

    ``sticky`` are the tags of the valves with friction.
    """

    options: StudyOptions
    seed: int
    sticky: tuple[str, ...]
    runs: Mapping[str, ColumnRun]


def run_trial(
    options: StudyOptions,
    seed: int,
    progress: Callable[[float], None] | None = None,
    columns: Sequence[Column] = COLUMNS,
) -> Trial:
    """Run every column with the same noise and the same set-points.

    The controllers know the true friction unless ``options.known`` gives another. Same options
    and seed give the same signals.

    Args:
        options: what is compared.
        seed: of noise and of held-out set-points.
        progress: called with the share done.
        columns: to run.
    """
    scenario = Scenario.load(find_config("tank.scenario.yaml"))
    valves = len(scenario.plant.valves)
    if options.known is not None and len(options.known) != valves:
        raise InputError(
            f"{len(options.known)} frictions for {valves} valves", where="known", fix="give each"
        )
    schedule, samples = _schedule(scenario, options, seed)
    runs = {}
    for done, column in enumerate(columns):
        runs[column.key] = _run(scenario, column, options, schedule, samples, seed)
        if progress is not None:
            progress((done + 1) / len(columns))
    sticky = tuple(valve.name for valve in scenario.plant.valves if valve.effects)
    return Trial(options, seed, sticky, runs)


def held_out_set_points(
    outputs: tuple[str, ...], start: FloatArray, sample_time: float, hold: int, seed: int
) -> SetPoints:
    """Return five moves, ``hold`` samples apart, the first of both outputs.

    The others are of the first, the second, or both.

    Args:
        outputs: two tags.
        start: set-points at the operating point, shape (2,).
        sample_time: s.
        hold: samples.
        seed: of the moves.
    """
    random = np.random.default_rng([seed, 4])
    reach = np.array(REACH)
    values = [np.array(start)]
    while len(values) <= MOVES:
        which = int(random.integers(3)) if len(values) > 1 else 2
        moved = np.array([(True, False), (False, True), (True, True)][which])
        drawn = start + random.uniform(-reach, reach)
        after = np.where(moved, drawn, values[-1])
        if np.all(np.abs(after - values[-1])[moved] >= reach[moved] / 5):
            values.append(after)
    times = np.append(0, FIRST_HOLD + hold * np.arange(MOVES)) * sample_time
    return SetPoints(outputs, times.astype(float), np.array(values))


def _schedule(scenario: Scenario, options: StudyOptions, seed: int) -> tuple[SetPoints, int]:
    if options.schedule == "scenario":
        whole = scenario.set_points.repeat / scenario.process.sample_time
        return scenario.set_points, round(whole)
    outputs, start = scenario.process.outputs, scenario.set_points.values[0]
    sample_time = scenario.process.sample_time
    found = held_out_set_points(outputs, start, sample_time, options.hold, seed)
    return found, FIRST_HOLD + MOVES * options.hold


def _run(
    scenario: Scenario,
    column: Column,
    options: StudyOptions,
    schedule: SetPoints,
    samples: int,
    seed: int,
) -> ColumnRun:
    plant = _plant(scenario, options)
    controller = _controller(scenario, column, options, plant)
    if not column.sticky:
        plant = plant.with_ideal_valves()
    results: list[StepResult] = []
    applied = plant.stem_start

    def control(measurement: Measurement, sp: FloatArray) -> FloatArray:
        last = results[-1].op if results else applied
        results.append(controller.step(measurement.pv, sp, measurement.dv, last))
        return results[-1].op

    run = simulate_closed_loop(plant, control, schedule, samples, seed)
    plans = [result.plan for result in results if isinstance(result.plan, PrintedPlan)]
    from_start = tuple(plan.warm_start_cost < plan.programme_cost for plan in plans)
    statuses = Counter(result.status.value for result in results)
    times = np.array([1e3 * result.solve_time for result in results])
    return ColumnRun(run, times, from_start, dict(statuses))


def _plant(scenario: Scenario, options: StudyOptions) -> LoopModel:
    if options.plant == "tank" and options.law == "he":
        return scenario.plant
    effects = {
        valve.name: tuple(_of_law(effect, options.law) for effect in valve.effects)
        for valve in scenario.plant.valves
    }
    model = scenario.plant if options.plant == "tank" else scenario.process
    return model.with_valve_effects(effects)


def _of_law(effect: Behaviour, law: str) -> Behaviour:
    if not isinstance(effect, HeStiction):
        return effect
    return behaviour_of(law, (effect.static_friction, effect.dynamic_friction), {})


def _controller(
    scenario: Scenario, column: Column, options: StudyOptions, plant: LoopModel
) -> MpcController:
    settings = scenario.controller
    if column.key != "exact":
        moves = tuple(options.move_scale * weight for weight in settings.move_weights)
        settings = dataclasses.replace(settings, preset=options.preset.value, move_weights=moves)
    if column.printed:
        settings = dataclasses.replace(
            settings,
            formulation="printed",
            warm_start=options.warm_start.value,
            programme_cost=options.programme_cost.value,
        )
    frictions: list[Stiction | None] = [
        next((effect for effect in valve.effects if isinstance(effect, Stiction)), None)
        for valve in plant.valves
    ]
    if options.known is not None:
        pairs = options.known
        frictions = [behaviour_of(options.law, p, {}) if max(p) else None for p in pairs]
    known = [None if friction is None else FrictionSpread(0.0, 0.0) for friction in frictions]
    return MpcController(settings.design(scenario.process), column.mode, frictions, known)
