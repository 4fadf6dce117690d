import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.records.run.bag_runs import Told, run_of, tell_runs

STEP = 10**9


def told(stamps: list[int]) -> list[list[int]]:
    """Return the stamps of each run, in steps."""
    found = tell(stamps).runs
    return [sorted(stamp // STEP for stamp in run.place) for run in found]


def tell(stamps: list[int]) -> Told:
    return tell_runs([stamp * STEP for stamp in stamps], range(len(stamps)))


def test_nothing_is_no_run() -> None:
    assert tell_runs([], []) == Told((), (), 0)


def test_a_gap_is_no_new_run() -> None:
    stamps = [*range(20), *range(500, 520), *range(9000, 9003)]
    assert told(stamps) == [stamps]


def test_a_restart_is_a_new_run_and_goes_on_beyond_the_end_of_the_old_one() -> None:
    first, second = list(range(100)), list(range(250))
    assert told(first + second) == [first, second]


@given(
    st.integers(12, 60),
    st.integers(12, 60),
    st.integers(300, 10**6),
    st.integers(0, 10),
    st.integers(0, 2**31),
)
def test_runs_that_overlap_in_the_log_are_told_apart(
    old: int, new: int, begin: int, mixed: int, seed: int
) -> None:
    """Messages of the old run come up to ten messages late, among those of the new one."""
    random = np.random.default_rng(seed)
    first, second = [begin + k for k in range(old)], list(range(new))
    late = first[old - mixed :]
    places = sorted(random.integers(0, min(new, 20), mixed).tolist())
    log = first[: old - mixed]
    for k, stamp in enumerate(second):
        log.append(stamp)
        log += [late[i] for i in range(mixed) if places[i] == k]
    assert told(log) == [first, second]


def test_two_plants_that_alternate_all_the_time_are_told_apart() -> None:
    log = [stamp for k in range(50) for stamp in (500 + k, k)]
    assert told(log) == [[500 + k for k in range(50)], list(range(50))]


@given(st.sets(st.integers(1, 98), max_size=15))
def test_lost_messages_break_no_run(lost: set[int]) -> None:
    kept = [k for k in range(100) if k not in lost]
    assert told(kept) == [kept]
    assert told(kept + kept) == [kept, kept]


@pytest.mark.parametrize("stray", [[-5], [10**9], [3, 2], [40, 10**6, 7]])
def test_a_few_stamps_out_of_order_are_no_run(stray: list[int]) -> None:
    log = [*range(50), *stray, *range(50, 90)]
    found = tell(log)
    assert [len(run.place) for run in found.runs] == [90]
    assert found.lost == len(stray)


def test_swapped_messages_are_put_in_order() -> None:
    log = [*range(30), 31, 30, *range(32, 60)]
    assert told(log) == [list(range(60))]
    assert tell(log).lost == 0


def test_a_sample_that_is_shown_again_is_one_sample() -> None:
    log = [*range(30), 29, 29, 29, *range(30, 50)]
    found = tell(log)
    assert (len(found.runs), len(found.runs[0].place), found.lost) == (1, 50, 0)
    assert found.runs[0].place[29 * STEP] == 29  # what was said first


def test_the_jitter_of_a_clock_is_no_run() -> None:
    random = np.random.default_rng(2)
    stamps = (np.arange(300) * STEP + random.uniform(-0.4, 0.4, 300) * STEP).astype(int).tolist()
    found = tell_runs(stamps, range(300))
    assert ([len(run.place) for run in found.runs], found.lost) == ([300], 0)


def test_another_signal_goes_to_the_run_that_is_nearest_in_the_log() -> None:
    log = [*range(100), *range(100)]
    runs = tell(log).runs
    assert run_of(runs, 50 * STEP, 51) is runs[0]
    assert run_of(runs, 50 * STEP, 152) is runs[1]
    assert run_of(runs, 99 * STEP, 101) is runs[0]  # late, when the second has begun
    assert run_of(runs, 500 * STEP, 152) is runs[1]
    assert run_of(runs, 500 * STEP, 52) is runs[0]


def test_another_signal_does_not_go_to_a_run_that_is_long_over() -> None:
    log = [*range(100), *range(50), *range(51, 100)]
    runs = tell(log).runs
    assert run_of(runs, 50 * STEP, 150) is runs[1]


def test_a_stretch_too_short_for_a_run_is_told_of_but_not_mixed_in() -> None:
    log = [*range(0, 50), *range(10, 18), *range(50, 90)]
    found = tell(log)
    assert [len(run.place) for run in found.runs] == [90]
    assert [len(run.place) for run in found.strays] == [8]
    assert found.lost == 8
