from __future__ import annotations

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.online.session import Scenario
from stiction_studies.examples.wear_study import (
    EXACT,
    FREE,
    UNAWARE,
    mean_score,
    priced,
    run_candidates,
    without,
)


@pytest.fixture(scope="module")
def tank() -> Scenario:
    return Scenario.load(find_config("tank.scenario.yaml"))


@pytest.mark.trial
def test_the_exact_embedding_spares_the_valve_and_keeps_the_set_points(tank: Scenario) -> None:
    runs = [run_candidates(tank, (FREE, UNAWARE, EXACT), seed) for seed in (211, 212)]
    free, unaware, exact = (mean_score([run[i] for run in runs]) for i in range(3))
    assert np.all(exact.iae <= 1.15 * free.iae)
    assert exact.travel <= 1.1 * unaware.travel
    assert exact.moves <= unaware.moves
    assert exact.reversals <= exact.moves
    assert exact.op_step <= 25.0


def test_what_a_move_is_worth_is_paid_in_moves(tank: Scenario) -> None:
    cheap, dear = priced(tank, (0.1, 3.0))
    assert cheap.settings["move_worth"] == pytest.approx([0.1 * tank.controller.move_worth[0], 0.0])
    one, other = run_candidates(tank, (cheap, dear), 41)
    assert other.moves < one.moves
    assert other.travel < 0.6 * one.travel
    assert other.iae[0] > one.iae[0]


def test_every_part_can_be_left_out(tank: Scenario) -> None:
    whole = tank.controller
    for candidate in without(tank):
        assert any(getattr(whole, key) != value for key, value in candidate.settings.items())
    (bare,) = run_candidates(tank, without(tank)[-1:], 41)
    (exact,) = run_candidates(tank, (EXACT,), 41)
    assert bare.travel > 1.5 * exact.travel
    assert bare.op_step > 30.0
