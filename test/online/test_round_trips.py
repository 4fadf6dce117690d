import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.online.round_trips import OPEN, RoundTrips


def asked(seconds: list[float]) -> RoundTrips:
    trips = RoundTrips()
    for stamp, time in enumerate(seconds):
        trips.ask(stamp, 100.0)
        trips.answer(stamp, 100.0 + time)
    return trips


@given(st.lists(st.floats(1e-5, 100.0), min_size=1, max_size=300))
def test_figures_are_those_of_all_samples_within_one_percent(seconds):
    found = asked(seconds).milliseconds()
    for name, share in (("p50", 50), ("p99", 99), ("p999", 99.9)):
        exact = 1e3 * float(np.percentile(seconds, share, method="inverted_cdf"))
        assert exact * (1 - 1e-6) <= found[name] <= exact * 1.011
    assert np.isclose(found["max"], 1e3 * max(seconds), rtol=1e-6)


def test_only_the_first_answer_counts_and_strangers_do_not():
    trips = RoundTrips()
    trips.answer(7, 1.0)
    trips.ask(1, 1.0)
    trips.ask(1, 5.0)
    trips.answer(1, 1.5)
    trips.answer(1, 9.0)
    assert (trips.asked, trips.answered, trips.longest) == (1, 1, 0.5)


def test_samples_without_an_answer_do_not_pile_up():
    trips = RoundTrips()
    for stamp in range(3 * OPEN):
        trips.ask(stamp, float(stamp))
    assert len(trips._open) == OPEN
    assert trips.milliseconds() == {}
    assert trips.asked == 3 * OPEN
