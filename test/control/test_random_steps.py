"""Random steps, feasible and not: STICTION_RANDOM_STEPS sets their number (default 600)."""

import dataclasses
import os

import numpy as np
import pytest
from loops import design_of, kalman, limits_for, luenberger, stable_model, weights_for

from stiction_ros.control import ControlMode, FrictionSpread, MpcController, StepStatus
from stiction_ros.control.result import StepResult
from stiction_ros.control.strategies import FallbackRule
from stiction_ros.effects import HeStiction, KanoStiction, SemiPhysicalStiction, XchStiction
from stiction_ros.errors import InputError

STEPS = int(os.environ.get("STICTION_RANDOM_STEPS", "600"))
STEPS_A_MODEL = 20
MODES = list(ControlMode)
HUGE = [np.nan, np.inf, -np.inf, 1e6, -1e9, 1e300]


class Trial:
    """One random controller; a copy of what it must respect."""

    def __init__(self, seed: int) -> None:
        self.random = random = np.random.default_rng(seed)
        self.p, self.m = int(random.integers(1, 4)), int(random.integers(1, 4))
        model = stable_model(seed, int(random.integers(1, 5)), self.m, self.p)
        if random.random() < 0.3:
            model = dataclasses.replace(model, e=random.normal(size=(model.order, 1)))
        self.low = float(random.uniform(0.0, 45.0))
        self.high = float(random.uniform(55.0, 100.0))
        move = float(random.choice([np.inf, 0.5, 5.0, 30.0]))
        output = (-1.0, 1.0) if random.random() < 0.3 else (-np.inf, np.inf)
        limits = limits_for(model, self.low, self.high, move, output)
        self.limits = dataclasses.replace(limits, iterations=int(random.choice([1, 8, 2000])))
        observer = kalman(self.p) if random.random() < 0.8 else luenberger(self.p)
        design = design_of(
            model, self.limits, weights_for(model, int(random.integers(2, 9))), observer
        )
        self.mode = MODES[seed % len(MODES)]
        rule = FallbackRule(
            int(random.integers(0, 4)),
            int(random.integers(0, 4)),
            np.full(self.m, 50.0),
            np.ones(self.m),
        )
        design = dataclasses.replace(design, fallback=rule)
        frictions, spreads = self.frictions(), self.spreads()
        try:
            self.controller = MpcController(design, self.mode, frictions, spreads)
        except InputError as error:  # no kick fits in
            if error.where != "op_rate_limits" or move == np.inf:
                raise
            design = design.without_rates()
            self.limits = design.limits
            self.controller = MpcController(design, self.mode, frictions, spreads)
        self.applied = random.uniform(self.low, self.high, self.m)
        self.d = model.e.shape[1]

    def frictions(
        self,
    ) -> list[HeStiction | KanoStiction | XchStiction | SemiPhysicalStiction | None]:
        static = float(self.random.choice([0.5, 5.0, 20.0, 150.0]))
        laws = [
            HeStiction(static, 0.3 * static),
            KanoStiction(1.5 * static, 0.5 * static),
            XchStiction(static, static),
            SemiPhysicalStiction(static, 0.7 * static, 1.5),
            None,
        ]
        found = [laws[self.random.integers(len(laws))] for _ in range(self.m)]
        if not any(found):
            found[0] = laws[0]
        return found

    def spreads(self) -> list[FrictionSpread | None]:
        return [FrictionSpread(0.2, 0.1) if self.random.random() < 0.5 else None] * self.m

    def values(self, size: int) -> np.ndarray:
        found = 10.0 ** self.random.uniform(-2, 4) * self.random.normal(size=size)
        if size and self.random.random() < 0.25:
            found[self.random.integers(size)] = HUGE[self.random.integers(len(HUGE))]
        return np.asarray(found)

    def step(self) -> StepResult:
        preview = None
        if self.random.random() < 0.3:
            preview = np.array([self.values(self.p) for _ in range(3)])
        applied = self.applied
        if self.random.random() < 0.1:
            applied = self.values(self.m)
        self.told = applied
        return self.controller.step(
            self.values(self.p), self.values(self.p), self.values(self.d), applied, preview
        )


def check(trial: Trial, result: StepResult) -> None:
    """Fail when the OP is invalid or the status is not true."""
    assert np.isfinite(result.op).all()
    assert np.all((result.op >= trial.low) & (result.op <= trial.high))
    held = result.status is StepStatus.HELD
    assert held == (result.strategy == "hold")
    assert (result.status is StepStatus.FALLBACK) == (result.strategy == "fallback")
    assert (result.plan is None) == (result.strategy in ("hold", "fallback"))
    assert (result.status is StepStatus.SHIFTED) == (result.strategy == "shift")
    assert (result.status is StepStatus.SUBSTITUTED) == (result.strategy == "unaware")
    assert (result.status is StepStatus.LIMIT) == (result.strategy == "limit")
    assert (result.age > 0) == (result.status is StepStatus.SHIFTED)
    assert result.reason or result.status is StepStatus.SOLVED
    assert (result.mode is ControlMode.HOLD) == (result.strategy in ("hold", "fallback"))
    if result.strategy == "solve":
        assert (result.status is StepStatus.UNREACHABLE) == bool(result.miss.any())
        assert result.plan is not None
        assert result.plan.converged
        if "rate limit" not in result.reason:
            assert result.plan.op == pytest.approx(result.op)
    if result.strategy != "fallback" and np.isfinite(trial.told).all():
        before = np.clip(trial.told, trial.low, trial.high)
        assert np.all(np.abs(result.op - before) <= trial.limits.move + 1e-9)


@pytest.mark.parametrize("part", range(4))
def test_no_step_raises_or_leaves_the_bounds_and_every_status_is_true(part: int) -> None:
    """A quarter of the steps each, over modes, laws, limits, and values that are no numbers."""
    seen = set()
    for number in range(-(-STEPS // (4 * STEPS_A_MODEL))):
        trial = Trial(7 * number + 1_000_000 * part)
        for _ in range(STEPS_A_MODEL):
            result = trial.step()
            check(trial, result)
            trial.applied = result.op
            seen.add(result.status)
    assert StepStatus.HELD in seen
