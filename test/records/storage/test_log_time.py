from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.records.storage.log_time import LogTime


def told(stamps: list[int], received: int = 10**18) -> list[int]:
    """Return the log time after each simulated time."""
    times = LogTime()
    found = []
    for stamp in stamps:
        times.see(stamp)
        found.append(times.of(received))
    return found


def test_without_simulated_time_it_is_the_time_of_reception() -> None:
    times = LogTime()
    assert [times.of(received) for received in (5, 7, 6, 9)] == [5, 7, 7, 9]


def test_the_first_simulated_time_takes_over() -> None:
    times = LogTime()
    assert times.of(10**18) == 10**18
    assert [times.see(stamp) for stamp in (3, 4)] == [True, False]
    assert times.of(10**18 + 5) == 4


def test_after_a_restart_it_goes_on_from_where_it_stood() -> None:
    found = told([*range(500, 600), *range(50)])
    assert found[:100] == list(range(500, 600))
    assert found[100:109] == [599] * 9
    assert found[109:] == [599 + k for k in range(9, 50)]


def test_two_clocks_that_alternate_are_the_later_one() -> None:
    assert told([stamp for k in range(100) for stamp in (500 + k, k)]) == [
        500 + k for k in range(100) for _ in range(2)
    ]


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 40)), max_size=200))
def test_it_never_runs_backwards_once_time_is_simulated(events: list[tuple[bool, int]]) -> None:
    times = LogTime()
    found, simulated = [], False
    for is_clock, stamp in events:
        if is_clock:
            simulated |= times.see(stamp) or simulated
        if simulated:
            found.append(times.of(stamp))
    assert found == sorted(found)
