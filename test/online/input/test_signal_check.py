import numpy as np
import pytest

from stiction_ros.loop import Instrument
from stiction_ros.online.input.signal_check import BELIEVED, SignalCheck

NAN = float("nan")

# values that come one a second -> what is believed of them
TABLE: dict[str, tuple[Instrument, list[float], list[float]]] = {
    "no limits": (Instrument(), [1.0, 1e9, -1e9], [1.0, 1e9, -1e9]),
    "no numbers": (Instrument(), [1.0, NAN, np.inf, 2.0], [1.0, NAN, NAN, 2.0]),
    "range": (Instrument(0.0, 10.0), [0.0, 10.0, 10.1, -0.1, 5.0], [0.0, 10.0, NAN, NAN, 5.0]),
    "rate": (Instrument(rate_limit=1.0), [5.0, 6.0, 8.0, 6.5], [5.0, 6.0, NAN, 6.5]),
    "the time since the last good one": (
        Instrument(rate_limit=1.0),
        [5.0, NAN, NAN, 8.0, 8.0, 8.0],
        [5.0, NAN, NAN, NAN, NAN, 8.0],
    ),
    "back where it was after a gap": (
        Instrument(rate_limit=1.0),
        [5.0, NAN, NAN, 5.8],
        [5.0, NAN, NAN, 5.8],
    ),
    "what an instrument shows first when it comes back": (
        Instrument(0.0, 100.0, 5.0),
        [50.0] + [1e6] * 10 + [0.0, 0.0, 50.1, 50.0],
        [50.0] + [NAN] * 12 + [50.1, 50.0],
    ),
    "one spike": (Instrument(rate_limit=1.0), [5.0, 50.0, 5.5], [5.0, NAN, 5.5]),
    "a wrong first one": (
        Instrument(rate_limit=0.1),
        [90.0] + [5.0] * (BELIEVED + 1),
        [90.0] + [NAN] * (BELIEVED - 1) + [5.0, 5.0],
    ),
    "wild ones never agree": (
        Instrument(rate_limit=0.1),
        [5.0] + [50.0, 70.0] * BELIEVED + [5.0],
        [5.0] + [NAN, NAN] * BELIEVED + [5.0],
    ),
}


@pytest.mark.parametrize("case", TABLE)
def test_what_is_believed(case: str) -> None:
    instrument, values, believed = TABLE[case]
    check = SignalCheck([instrument])
    found = [float(check.measured(float(k), np.array([v]))[0]) for k, v in enumerate(values)]
    assert found == pytest.approx(believed, nan_ok=True)


def test_outputs_are_checked_one_by_one() -> None:
    check = SignalCheck([Instrument(0.0, 1.0), Instrument()])
    assert check.measured(0.0, np.array([5.0, 5.0])) == pytest.approx([NAN, 5.0], nan_ok=True)


def test_a_new_run_forgets_the_last_good_value() -> None:
    check = SignalCheck([Instrument(rate_limit=1.0)])
    check.measured(0.0, np.array([5.0]))
    check.forget()
    assert check.measured(1.0, np.array([50.0])) == [50.0]


@pytest.mark.parametrize(("value", "good"), [(0.5, True), (2.0, False), (NAN, False)])
def test_a_set_point_may_step_within_its_range(value: float, good: bool) -> None:
    check = SignalCheck([Instrument(0.0, 1.0, 1e-6)])
    assert check.within(np.array([value])) is good
