from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.online.session import Scenario
from stiction_ros.signals.holds import holds
from stiction_studies.examples.wear_floor import LONGEST, floor_of, least_iae, least_iae_beside
from stiction_studies.examples.wear_study import schedule_of

SEED, JUMP = 101, 7.0
TANK = Scenario.load(find_config("tank.scenario.yaml"))
FLOOR = least_iae(TANK, SEED, JUMP)
SECOND_JUMP = 4.0
WANTED = np.array([[7.5, 42.324]] * 40 + [[7.5, 43.6]] * 120 + [[7.7, 43.6]] * 150)
BESIDE = least_iae_beside(TANK.plant.process, WANTED, SECOND_JUMP)  # type: ignore[arg-type]


def soon_after(wanted: np.ndarray) -> st.SearchStrategy[list[int]]:
    """Return samples at which somebody may act on a set-point that has moved, shape (N, …)."""
    begins = [begin for begin, _ in holds(wanted)][1:]
    waits = st.tuples(st.sampled_from(begins), st.integers(0, LONGEST)).map(sum)
    return st.lists(waits.filter(lambda place: place < len(wanted)), max_size=6, unique=True)


def set_points_of_tank() -> np.ndarray:
    """Return those of C, shape (N, 1)."""
    schedule, samples = schedule_of(TANK, SEED)
    return np.array([schedule.at(k * TANK.plant.sample_time)[:1] for k in range(samples)])


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
@given(places=soon_after(set_points_of_tank()), seed=st.integers(0, 10_000))
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


def rest_of_first(concentration: float) -> float:
    """Return the stem of valve 1 at which C of the tank rests, %."""
    stems = np.linspace(30.0, 70.0, 40_001)
    rests = [TANK.plant.process.steady_state(np.array([stem, 50.0]))[0] for stem in stems[::400]]
    return float(np.interp(concentration, rests, stems[::400]))


FIRST = {value: rest_of_first(value) for value in np.unique(WANTED[:, 0])}


def iae_of_second(stems: np.ndarray) -> float:
    """Return the IAE of T of the tank itself, °C · h, for stems of valve 2, shape (N,), %."""
    process = TANK.plant.process
    state = process.rest(np.array([50.0, 50.0]), np.array([7.5, 42.324]))
    total = 0.0
    for stem, (concentration, temperature) in zip(stems, WANTED, strict=True):
        total += abs(process.output(state)[1] - temperature)
        valves = np.array([FIRST[concentration], stem])
        state = process.advance(state, valves, np.zeros(5), np.zeros(2))
    return total * process.sample_time / 3600.0


def test_more_moves_of_the_second_valve_never_cost_more() -> None:
    assert np.all(np.diff(BESIDE) <= 0.0)
    assert 0.0 < BESIDE[-1] < 0.1 * BESIDE[0]


def test_a_second_valve_that_rests_has_the_iae_of_the_tank() -> None:
    assert BESIDE[0] == pytest.approx(iae_of_second(np.full(len(WANTED), 50.0)), rel=2e-3)


@settings(max_examples=25, deadline=None)
@given(places=soon_after(WANTED), seed=st.integers(0, 10_000))
def test_no_second_valve_is_below_it(places: list[int], seed: int) -> None:
    random = np.random.default_rng(seed)
    stems = np.full(len(WANTED), 50.0)
    for place in sorted(places):
        at, goal = stems[place - 1], random.uniform(30.0, 70.0)
        stems[place:] = goal if abs(goal - at) >= SECOND_JUMP else at
    moves = int(np.count_nonzero(np.diff(stems)))
    assert iae_of_second(stems) >= 0.999 * BESIDE[min(moves, len(BESIDE) - 1)]


def test_who_knows_a_set_point_before_it_moves_may_be_below_it() -> None:
    stems = np.full(len(WANTED), 50.0)
    stems[150:] = 59.7  # ten samples before the second set-point
    assert iae_of_second(stems) < 0.95 * BESIDE[1]


@pytest.mark.trial
def test_the_floor_is_met_by_going_beyond_and_coming_back() -> None:
    process = TANK.plant.process
    wanted = np.repeat([[7.5, 42.324], [7.5, 43.6]], [5, 100], axis=0)
    floor = least_iae_beside(process, wanted, SECOND_JUMP)  # type: ignore[arg-type]
    rests = [50.0, float(np.interp(43.6, [42.324, 45.289], [50.0, 60.0]))]
    best = np.inf
    for high in np.linspace(60.0, 100.0, 81):
        for samples in range(1, 8):
            state, total = process.rest(np.array([50.0, 50.0]), np.array([7.5, 42.324])), 0.0
            for k in range(100):
                total += abs(process.output(state)[1] - 43.6)
                stem = high if k < samples else rests[1]
                state = process.advance(state, np.array([50.0, stem]), np.zeros(5), np.zeros(2))
            best = min(best, total / 60.0)
    assert floor[2] == pytest.approx(best, rel=0.03)


def test_set_points_that_do_not_stay_are_refused() -> None:
    wanted = np.repeat([[7.5, 42.324], [7.5, 43.6], [7.5, 42.0]], [40, 60, 120], axis=0)
    with pytest.raises(InputError, match="90 samples"):
        least_iae_beside(TANK.plant.process, wanted, SECOND_JUMP)  # type: ignore[arg-type]


def test_the_floor_of_a_scenario_is_that_of_its_set_points() -> None:
    schedule, samples = schedule_of(TANK, SEED)
    wanted = np.array([schedule.at(60.0 * k)[0] for k in range(samples)])
    assert np.array_equal(floor_of(TANK.plant.process, wanted, JUMP), FLOOR)  # type: ignore[arg-type]


def test_another_process_is_refused() -> None:
    siso = Scenario.load(find_config("siso.scenario.yaml"))
    with pytest.raises(InputError, match="stirred tank"):
        least_iae(siso, SEED, JUMP)
