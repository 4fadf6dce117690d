"""Intervals of friction: what they hold, and how they grow."""

import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.identification import IdentificationOptions
from stiction_ros.identification.exact.intervals import (
    FrictionIntervals,
    Interval,
    friction_intervals,
)
from stiction_ros.identification.problem.models import Data, Model, linear_model, with_valve
from stiction_ros.identification.problem.preparation import prepare, window

OPTIONS = IdentificationOptions(output_order=3, input_order=3, delay=(5, 5))
TRUTHS = {"jump": (5.0, 2.0), "deadband": (3.0, 3.0)}


def at_truth(friction: tuple[float, float]) -> tuple[Data, Model]:
    """Return Example 1, shortened, with the true friction in its model."""
    record = loops.example1(3, samples=900, friction=friction)
    data = prepare(record, OPTIONS)
    linear = linear_model(data, window(OPTIONS, 3, 3))
    return data, with_valve(data, linear, 0, np.array(friction), 0.0, np.array([5]))


def found(case: tuple[Data, Model], confidence: float) -> FrictionIntervals:
    return friction_intervals(*case, 0, confidence)


@pytest.fixture(scope="module")
def levels() -> dict[str, dict[float, FrictionIntervals]]:
    cases = {name: at_truth(friction) for name, friction in TRUTHS.items()}
    return {
        name: {level: found(case, level) for level in (0.8, 0.99)} for name, case in cases.items()
    }


@pytest.mark.parametrize("name", TRUTHS)
def test_the_truth_and_the_estimate_lie_inside(
    levels: dict[str, dict[float, FrictionIntervals]], name: str
) -> None:
    wide, (static, dynamic) = levels[name][0.99], TRUTHS[name]
    for interval, truth in ((wide.static, static), (wide.dynamic, dynamic)):
        assert interval[0] - 1e-9 <= truth <= interval[1] + 1e-9
    assert wide.static[0] <= wide.static_estimate <= wide.static[1]
    assert wide.dynamic[0] <= wide.dynamic_estimate <= wide.dynamic[1]
    assert wide.dynamic_estimate <= wide.static_estimate


@pytest.mark.parametrize("name", TRUTHS)
def test_a_higher_level_holds_the_lower_one(
    levels: dict[str, dict[float, FrictionIntervals]], name: str
) -> None:
    narrow, wide = levels[name][0.8], levels[name][0.99]
    for inner, outer in ((narrow.static, wide.static), (narrow.dynamic, wide.dynamic)):
        assert holds(outer, inner)


def test_only_a_jump_rejects_the_deadband(
    levels: dict[str, dict[float, FrictionIntervals]],
) -> None:
    assert levels["jump"][0.99].deadband_loss > 100.0
    assert 0.0 <= levels["deadband"][0.99].deadband_loss < 4.0


def holds(outer: Interval, inner: Interval) -> bool:
    return outer[0] <= inner[0] + 1e-9 and inner[1] <= outer[1] + 1e-9
