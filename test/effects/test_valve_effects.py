"""Laws of the valve's effects other than friction."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import (
    Backlash,
    Behaviour,
    Characteristic,
    HeStiction,
    Lag,
    Offset,
    Saturation,
    Slew,
)
from stiction_ros.errors import InputError

numbers = st.floats(-150.0, 150.0)
signals = st.lists(numbers, min_size=2, max_size=40).map(np.array)
sample_times = st.sampled_from([0.5, 1.0, 10.0])
positive = st.floats(1e-3, 50.0)


@given(positive, signals, numbers)
def test_backlash_is_stiction_without_a_jump(band: float, op: np.ndarray, start: float) -> None:
    friction = HeStiction(band / 2.0, band / 2.0)
    expected = friction.simulate(op, start)
    assert Backlash(band).simulate(op, start) == pytest.approx(expected, abs=1e-9)


def test_backlash_loses_its_band_at_every_reversal() -> None:
    op = np.array([0.0, 10.0, 8.0, 6.0, 4.0, 10.0])
    assert Backlash(4.0).simulate(op).tolist() == [0.0, 8.0, 8.0, 8.0, 6.0, 8.0]


@given(positive, signals, numbers, sample_times)
def test_slew_never_exceeds_its_rate(
    rate: float, op: np.ndarray, start: float, sample_time: float
) -> None:
    stem = Slew(rate).simulate(op, start, sample_time)
    assert np.abs(np.diff(stem)).max() <= rate * sample_time * (1.0 + 1e-9) + 1e-9


@given(signals)
def test_a_slew_that_nothing_reaches_is_none(op: np.ndarray) -> None:
    assert Slew(1e4).simulate(op).tolist() == op.tolist()


def test_slew_ramps_and_arrives() -> None:
    assert Slew(2.0).simulate(np.array([0.0, 5.0, 5.0, 5.0])).tolist() == [0.0, 2.0, 4.0, 5.0]


@given(signals, sample_times)
def test_a_lag_without_time_constant_is_none(op: np.ndarray, sample_time: float) -> None:
    assert Lag(0.0).simulate(op, sample_time=sample_time).tolist() == op.tolist()


@given(positive, signals, numbers)
def test_a_lag_stays_between_its_past_and_its_input(
    tau: float, op: np.ndarray, start: float
) -> None:
    out = Lag(tau).simulate(op, start)
    last = np.concatenate([[start], out[:-1]])
    assert np.all(out >= np.minimum(last, op) - 1e-9)
    assert np.all(out <= np.maximum(last, op) + 1e-9)


@pytest.mark.parametrize("sample_time", [0.5, 2.0])
def test_a_lag_has_moved_by_63_per_cent_after_its_time_constant(sample_time: float) -> None:
    op = np.array([0.0] + [1.0] * 40)
    out = Lag(10.0).simulate(op, sample_time=sample_time)
    assert out[round(10.0 / sample_time)] == pytest.approx(1.0 - np.exp(-1.0))


@given(signals, numbers, numbers)
def test_saturation_clips(op: np.ndarray, one: float, two: float) -> None:
    low, high = min(one, two), max(one, two)
    assert Saturation(low, high).simulate(op).tolist() == op.clip(low, high).tolist()


def test_crossed_limits_are_refused() -> None:
    with pytest.raises(InputError, match="low"):
        Saturation(60.0, 40.0)


@given(st.floats(-6.0, 6.0))
def test_a_characteristic_keeps_both_ends_and_rises(curve: float) -> None:
    out = Characteristic(curve).simulate(np.linspace(0.0, 100.0, 21))
    assert (out[0], out[-1]) == pytest.approx((0.0, 100.0), abs=1e-9)
    assert np.all(np.diff(out) > 0.0)


@given(numbers)
def test_a_straight_characteristic_is_none(op: float) -> None:
    assert Characteristic(0.0).step(0.0, op)[1] == op
    assert Characteristic(2e-6).step(0.0, op)[1] == pytest.approx(op, abs=1e-3)


def test_a_positive_curve_opens_slowly_first() -> None:
    assert Characteristic(3.0).step(0.0, 50.0)[1] < 50.0 < Characteristic(-3.0).step(0.0, 50.0)[1]


def test_an_offset_adds() -> None:
    assert Offset(-3.0).simulate(np.array([50.0, 60.0])).tolist() == [47.0, 57.0]


GRIDS: dict[str, tuple[type[Behaviour], list[list[float]]]] = {
    "backlash": (Backlash, [[0.0], [3.0], [8.0]]),
    "slew": (Slew, [[0.0], [0.3], [5.0]]),
    "lag": (Lag, [[0.0], [0.5], [20.0]]),
    "saturation": (Saturation, [[-20.0, 30.0], [0.0, 0.0]]),
    "characteristic": (Characteristic, [[0.0], [1.0], [-4.0]]),
    "offset": (Offset, [[0.0], [2.5]]),
}


@pytest.mark.parametrize("name", GRIDS)
@given(op=signals, start=numbers, sample_time=sample_times)
def test_a_grid_is_one_simulation_per_row(
    name: str, op: np.ndarray, start: float, sample_time: float
) -> None:
    kind, rows = GRIDS[name]
    timed = {"sample_time": sample_time} if name in ("slew", "lag") else {}
    found = kind.simulate_grid(np.array(rows), op, start, **timed)  # type: ignore[attr-defined]
    assert found.shape == (len(op), len(rows))
    for column, row in zip(found.T, rows, strict=True):
        expected = kind(*row).simulate(op, start, sample_time)
        assert column == pytest.approx(expected, rel=1e-12, abs=1e-9)
