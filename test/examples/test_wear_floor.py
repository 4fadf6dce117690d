from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.examples.wear_floor import least_iae
from stiction_ros.examples.wear_study import schedule_of
from stiction_ros.online.session import Scenario

SEED, JUMP = 101, 7.0
TANK = Scenario.load(find_config("tank.scenario.yaml"))
FLOOR = least_iae(TANK, SEED, JUMP)


def iae_of(stems: np.ndarray) -> float:
    """Return the IAE of C of the tank itself, PV · h, for stems of valve 1, shape (N,), %."""
    process, sample_time = TANK.plant.process, TANK.plant.sample_time
    schedule, samples = schedule_of(TANK, SEED)
    assert len(stems) == samples
    state = process.rest(np.array([50.0, 50.0]), np.array([7.5, 42.324]))
    total = 0.0
    for k, stem in enumerate(stems):
        total += abs(process.output(state)[0] - schedule.at(k * sample_time)[0])
        state = process.advance(state, np.array([stem, 50.0]), np.zeros(5), np.zeros(2))
    return total * sample_time / 3600.0


def test_more_moves_never_cost_more() -> None:
    assert np.all(np.diff(FLOOR) <= 0.0)
    assert FLOOR[-1] > 0.0


def test_without_a_move_it_is_the_iae_of_a_stem_that_rests() -> None:
    samples = schedule_of(TANK, SEED)[1]
    assert FLOOR[0] == pytest.approx(iae_of(np.full(samples, 50.0)), rel=1e-3)


@settings(max_examples=25, deadline=None)
@given(
    places=st.lists(st.integers(1, 619), min_size=1, max_size=6, unique=True),
    seed=st.integers(0, 10_000),
)
def test_no_run_of_the_tank_is_below_it(places: list[int], seed: int) -> None:
    random = np.random.default_rng(seed)
    samples = schedule_of(TANK, SEED)[1]
    stems = np.full(samples, 50.0)
    for place in sorted(places):
        at = stems[place - 1]
        goal = random.uniform(20.0, 80.0)
        stems[place:] = goal if abs(goal - at) >= JUMP else at
    moves = int(np.count_nonzero(np.diff(stems)))
    assert iae_of(stems) >= 0.999 * FLOOR[min(moves, len(FLOOR) - 1)]


def test_another_process_is_refused() -> None:
    siso = Scenario.load(find_config("siso.scenario.yaml"))
    with pytest.raises(InputError, match="stirred tank"):
        least_iae(siso, SEED, JUMP)
