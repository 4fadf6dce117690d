from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.online.input.sample_grid import SUCCESSION, Pace, SampleGrid, Succession

STEP = 1000


@given(st.lists(st.integers(-200, 200), max_size=200), st.integers(-1, 1))
def test_stamps_that_wander_keep_their_numbers(jitter: list[int], drift: int) -> None:
    grid = SampleGrid(STEP)
    grid.begin(0)
    for k, shift in enumerate(jitter, start=1):
        stamp = k * (STEP + 20 * drift) + shift
        assert grid.ahead(stamp) == 1
        grid.advance(stamp)
        assert grid.number == k


@given(st.integers(0, 10**18), st.integers(1, 50))
def test_exact_stamps_stay_exact(first: int, count: int) -> None:
    grid = SampleGrid(STEP)
    grid.begin(first)
    for k in range(1, count):
        grid.advance(first + k * STEP)
    assert grid.stamp_of(0) == first
    assert grid.number + grid.ahead(first + 3 * STEP) == 3


def test_numbers_go_on_when_a_run_begins_anew() -> None:
    grid = SampleGrid(STEP)
    grid.begin(5000)
    grid.advance(None)
    grid.begin(100)
    assert (grid.number, grid.stamp_of(2)) == (2, 100)


def test_only_stamps_in_succession_that_rise_make_a_run() -> None:
    rising = Succession(standing=False)
    assert [rising.add(k, True) for k in range(SUCCESSION)] == [False] * (SUCCESSION - 1) + [True]
    standing = Succession(standing=False)
    assert not any(standing.add(5, True) for _ in range(50))
    falling = Succession(standing=True)
    assert not any(falling.add(-k, True) for k in range(50))
    jumping = Succession(standing=True)
    assert not any(jumping.add(k * 10**9, False) for k in range(50))
    shown_again = Succession(standing=True)
    assert any(shown_again.add(5, True) for _ in range(SUCCESSION))


def test_the_pace_is_what_was_set_until_samples_come_slower() -> None:
    pace = Pace(0.1)
    for k in range(20):
        pace.show(0.05 * k, k * STEP, STEP)
    assert pace.period == 0.1
    for k in range(20, 40):
        pace.show(1.0 * k, k * STEP, STEP)
    assert pace.period == 1.0


def test_one_long_pause_is_no_slow_pace() -> None:
    pace = Pace(0.1)
    for k in range(20):
        pace.show(0.1 * k + (60.0 if k > 10 else 0.0), k * STEP, STEP)
    assert abs(pace.period - 0.1) < 1e-6
