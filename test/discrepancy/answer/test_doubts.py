"""Intervals that hold what the words leave in doubt."""

from types import SimpleNamespace
from typing import Any

import pytest

from stiction_ros.discrepancy.answer.found_effects import behind_slope, without_its_jump
from stiction_ros.effects import HeStiction


def friction(*alternatives: tuple[str, str]) -> Any:
    return SimpleNamespace(
        place="valve:V1",
        effect="stiction",
        behaviour=HeStiction(3.3, 2.3),
        alternatives=alternatives,
    )


def test_a_jump_that_is_in_doubt_may_be_none() -> None:
    sure = {"f_s": (3.2, 3.4), "f_d": (2.2, 2.4)}
    assert without_its_jump(sure, friction()) == sure
    found = without_its_jump(sure, friction(("valve:V1", "backlash")))
    assert found["f_s"] == pytest.approx((2.8, 3.4))
    assert found["f_d"] == pytest.approx((2.2, 2.8))


def test_the_size_of_a_load_is_told_on_either_side_of_a_curves_slope() -> None:
    own = {"amplitude": (0.5, 0.6), "period": (80.0, 81.0)}
    assert behind_slope(own, 1.0) == own
    assert behind_slope(own, 1.1)["amplitude"] == pytest.approx((0.5, 0.66))
    assert behind_slope(own, 1.1)["period"] == (80.0, 81.0)
    assert behind_slope({"rate": (-0.2, -0.1)}, 1.1)["rate"] == pytest.approx((-0.22, -0.1))
