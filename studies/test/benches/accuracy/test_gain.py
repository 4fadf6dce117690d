import pytest

from stiction_ros.gain.gain import What
from stiction_studies.benches.accuracy.gain import Judged, Promise, _row


@pytest.mark.parametrize(
    ("said", "true", "kept", "broken"),
    [
        (0.5, 0.6, True, False),
        (0.5, 0.8, False, False),
        (0.04, 0.0, True, False),
        (0.8, 1.0, True, True),
        (0.95, 1.2, True, False),
        (0.5, 1.1, False, True),
    ],
)
def test_promises_are_kept_or_broken(said: float, true: float, kept: bool, broken: bool) -> None:
    promise = Promise("service", "iae_per_hour", said, true)
    assert (promise.kept, promise.broken) == (kept, broken)


def test_a_loop_keeps_its_word_in_amplitude_and_iae() -> None:
    good = Promise("service", "iae_per_hour", 0.5, 0.5)
    bad = Promise("service", "amplitude", 0.5, 1.5)
    rows = [
        Judged(1, "sticky", "sticky", (good,)),
        Judged(2, "sticky", "sticky", (good, bad)),
        Judged(3, "healthy", "undecided", (good,)),
        Judged(4, "healthy", "refused", (), "no"),
    ]
    every, found = _row(rows, What.SERVICE, False), _row(rows, What.SERVICE, True)
    assert (every["loops"], every["said"], every["kept"], every["broken"]) == (4, 3, 2, 1)
    assert (found["loops"], found["said"], found["kept"], found["broken"]) == (2, 2, 1, 1)
