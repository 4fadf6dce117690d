"""``stiction bench control``: one control step against IPOPT and the paper's programme.

Problems are taken from the recorded limit cycle of a loop; all methods of a row solve the same.
"""

import dataclasses
import functools
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from stiction_ros.cli.shared.scenarios import find
from stiction_ros.control import ControlDesign, ControlMode, MpcController, Plan
from stiction_ros.control.observer import Observer
from stiction_ros.control.target import TargetSelector
from stiction_ros.control.unaware import UnawareMpc
from stiction_ros.control_settings import ControlSettings
from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.session import Scenario, run_live
from stiction_ros.paper.controllers.augmented_cost import AugmentedCost, PlanProblem
from stiction_ros.paper.controllers.embedding import PrintedEmbeddingMpc
from stiction_ros.paper.controllers.smoothed_programme import SmoothedProgramme
from stiction_ros.paper.controllers.weights import (
    AugmentedWeights,
    PaperTuning,
    WeightPreset,
    augmented_weights,
)
from stiction_ros.records import Record
from stiction_studies.benches.speed.row import Row, row
from stiction_studies.examples import coupled_loop

Show = Callable[[float, str], None]
Frictions = tuple[HeStiction | None, ...]
T = TypeVar("T")

SU, SE = "SU", "SE, exact"
IPOPT, PRINTED = "CasADi and IPOPT", "SE as printed"
VALVE_FRICTION = HeStiction(5.0, 2.0)
SETTLE = 20  # samples after which the observer shows the loop


@dataclasses.dataclass(frozen=True)
class ControlPlan:
    """What a run of the benchmark works through.

    Attributes:
        problems: of the loop of Example 2, for the quadratic programmes.
        programmes: of them, for the paper's embedding.
        growth: problems per point of growing horizons and valves.
        horizons: N_H that are tried, samples.
        valves: numbers of sticky valves.
        seed: of the records.
    """

    problems: int = 300
    programmes: int = 300
    growth: int = 50
    horizons: tuple[int, ...] = (10, 20, 50, 100, 200)
    valves: tuple[int, ...] = (1, 2, 3)
    seed: int = 7

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise InputError(f"{self.seed} is negative", where="--seed", fix="use 0 or more")


FULL = ControlPlan()
QUICK = ControlPlan(problems=60, programmes=30, growth=15, horizons=(10, 50))


@dataclasses.dataclass(frozen=True)
class Loop:
    """A loop whose problems are solved.

    Attributes:
        model: process of the controller.
        settings: weights; the horizon is replaced where it grows.
        record: of the limit cycle.
        frictions: of its valves.
    """

    model: LoopModel
    settings: ControlSettings
    record: Record
    frictions: Frictions

    def design(self, horizon: int | None = None) -> ControlDesign:
        """Return the design, with another horizon where given."""
        settings = self.settings
        if horizon is not None:
            settings = dataclasses.replace(settings, horizon=horizon)
        return settings.design(self.model)

    def problems(self, count: int, *, aware: bool) -> list[PlanProblem]:
        """Return ``count`` problems spread over the record; ``aware`` takes χ̂ for the stem."""
        record, design = self.record, self.design()
        assert record.sp is not None
        stems = record.op.copy()
        for j, friction in enumerate(self.frictions if aware else ()):
            if friction is not None:
                stems[:, j] = friction.simulate(stems[:, j])
        observer = Observer(design.model, design.observer)
        selector = TargetSelector(design.model, design.target_weights, design.limits.stem)
        observer.rest(stems[0], record.pv[0])
        nothing = np.zeros(design.model.e.shape[1])
        found = []
        for k in range(1, len(record)):
            observer.predict(stems[k - 1], nothing)
            observer.correct(record.pv[k])
            target = selector.select(record.sp[k], observer.disturbance, nothing)
            if target is not None and k >= SETTLE:
                found.append(PlanProblem(observer.state, stems[k - 1], target))
        picks = np.linspace(0, len(found) - 1, min(count, len(found))).round().astype(int)
        return [found[k] for k in picks]


def control(plan: ControlPlan, show: Show) -> list[Row]:
    """Return all rows.

    Args:
        plan: what to work through.
        show: called with the share done, 0 to 1, and what is being done.
    """
    loop = tank(plan.seed)
    stages: list[tuple[str, Callable[[], list[Row]]]] = [
        ("unaware", lambda: _unaware_rows(loop, plan.problems)),
        ("embedding", lambda: [_embedding_row("tank", loop, plan.programmes, None)]),
    ]
    stages += [
        (f"N_H = {horizon}", functools.partial(_pair, loop, plan.growth, horizon))
        for horizon in plan.horizons
    ]
    stages += [
        (f"m = {count}", functools.partial(_valve_rows, count, plan)) for count in plan.valves
    ]
    rows: list[Row] = []
    for done, (text, work) in enumerate(stages):
        show(done / len(stages), text)
        rows += work()
    show(1.0, "done")
    return rows


def tank(seed: int) -> Loop:
    """Return Example 2's nonlinear tank in its limit cycle, N = 620."""
    scenario = Scenario.load(find("tank"))
    run = run_live(scenario, seed=seed, samples=620, identify=False)
    return Loop(scenario.process, scenario.controller, run.run.record, (HeStiction(8.0, 1.0), None))


def _unaware_rows(loop: Loop, count: int) -> list[Row]:
    """Compare a plan with that of IPOPT."""
    design = loop.design()
    problems = loop.problems(count, aware=False)
    quadratic = UnawareMpc(design.model, design.unaware, design.limits)
    fast, plans = _timed(lambda at: _plan(quadratic, at), problems)
    ours = [_first_op(plan) for plan in plans]
    case = f"tank, N_H = {design.unaware.horizon}"
    times, theirs = _timed(_plain_ipopt(design), problems)
    return [row(case, (SU, IPOPT), fast, times, _agreement(ours, theirs, times))]


def _pair(loop: Loop, count: int, horizon: int) -> list[Row]:
    """Compare the quadratic programmes with the nonlinear ones at one horizon."""
    case = f"tank, N_H = {horizon}"
    return [_quadratic_row(case, loop, count, horizon), _embedding_row(case, loop, count, horizon)]


def _valve_rows(valves: int, plan: ControlPlan) -> list[Row]:
    loop = sticky_valves(plan.seed, valves)
    case = f"m = {valves}, all sticky"
    return [
        _quadratic_row(case, loop, plan.growth, None),
        _embedding_row(case, loop, plan.growth, None),
    ]


def sticky_valves(seed: int, valves: int) -> Loop:
    """Return a loop of ``valves`` valves, all with f_S = 5 and f_D = 2, and N_H = 50."""
    example = coupled_loop(seed, valves, 300)
    settings = ControlSettings(horizon=50, move_weights=(0.1,), embedding_move_weights=(0.1,))
    process = example.truth.with_ideal_valves()
    return Loop(process, settings, example.record, (VALVE_FRICTION,) * valves)


def _quadratic_row(case: str, loop: Loop, count: int, horizon: int | None) -> Row:
    design = loop.design(horizon)
    problems = loop.problems(count, aware=False)
    quadratic = UnawareMpc(design.model, design.unaware, design.limits)
    fast, plans = _timed(lambda at: _plan(quadratic, at), problems)
    slow, theirs = _timed(_plain_ipopt(design), problems)
    fast = np.append(fast, _timed(lambda at: _plan(quadratic, at), problems)[0])
    ours = [_first_op(plan) for plan in plans]
    return row(case, (SU, IPOPT), fast, slow, _agreement(ours, theirs, slow))


def _embedding_row(case: str, loop: Loop, count: int, horizon: int | None) -> Row:
    design = loop.design(horizon)
    problems = loop.problems(count, aware=True)
    exact = MpcController(design, ControlMode.EMBEDDING, loop.frictions)
    formulation = exact._formulation
    assert formulation is not None
    fast, _ = _timed(lambda at: formulation.plan(at.state, at.target, at.stem), problems)
    length = design.embedding.horizon
    tuning = PaperTuning(augmented_weights(WeightPreset.CORRECTED, design.model, length))
    printed = PrintedEmbeddingMpc(design.model, tuning, design.limits, loop.frictions)
    slow, plans = _timed(lambda at: printed.plan(at.state, at.target, at.stem), problems)
    again, _ = _timed(lambda at: formulation.plan(at.state, at.target, at.stem), problems)
    fast = np.append(fast, again)
    iterations = np.median([plan.iterations for plan in plans if plan is not None])
    note = f"{len(problems)} problems, {iterations:.0f} iterations; {_last(slow)}"
    if case == "tank":
        case = f"tank, N_H = {length}"
    return row(case, (SE, PRINTED), fast, slow, note)


def _plain_ipopt(design: ControlDesign) -> Callable[[PlanProblem], FloatArray]:
    """Return (19) as a sparse programme of CasADi that IPOPT solves; built once."""
    m, weights = len(design.model.stem0), design.unaware
    nothing = np.zeros((m, m))
    told = weights.horizon, weights.state, weights.move, weights.terminal
    augmented = AugmentedWeights(*told, stem=nothing, op=nothing)
    healthy: Frictions = (None,) * m
    cost = AugmentedCost(design.model, augmented, healthy)
    programme = SmoothedProgramme(cost, PaperTuning(augmented), design.limits.stem)

    def solve(at: PlanProblem) -> FloatArray:
        start = np.tile(at.stem, (cost.horizon, 1))
        found = programme.solve(at, start, start)
        return np.full(m, np.nan) if found.op is None else found.op[0]

    return solve


def _timed(
    method: Callable[[PlanProblem], T], problems: Sequence[PlanProblem]
) -> tuple[FloatArray, list[T]]:
    """Return ms and answer of every problem; the first is solved once more ahead of all."""
    method(problems[0])
    times, answers = np.empty(len(problems)), []
    for k, at in enumerate(problems):
        begin = time.perf_counter()
        answers.append(method(at))
        times[k] = 1e3 * (time.perf_counter() - begin)
    return times, answers


def _plan(quadratic: UnawareMpc, at: PlanProblem) -> Plan | None:
    return quadratic.plan(at.state, at.target, at.stem)


def _first_op(plan: Plan | None) -> FloatArray:
    return np.full(1, np.nan) if plan is None else plan.op


def _agreement(ours: Sequence[FloatArray], theirs: Sequence[FloatArray], times: FloatArray) -> str:
    apart = np.array([np.abs(a - b).max() for a, b in zip(ours, theirs, strict=True)])
    return f"{len(ours)} problems, OP apart by at most {apart.max():.1g} %; {_last(times)}"


def _last(times: FloatArray) -> str:
    return f"p99 of the baseline {np.percentile(times, 99):.3g} ms"
