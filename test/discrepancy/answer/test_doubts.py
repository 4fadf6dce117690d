"""Intervals that hold what the words leave in doubt."""

from types import SimpleNamespace
from typing import Any

import pytest

from stiction_ros.discrepancy.answer.found_effects import without_its_jump
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
