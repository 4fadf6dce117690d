"""Laws of the effects on a process."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects import (
    Behaviour,
    ExtraDelay,
    ExtraPole,
    Filter,
    Lag,
    Leak,
    ProcessGain,
    TimeShift,
)

numbers = st.floats(-150.0, 150.0)
signals = st.lists(numbers, min_size=2, max_size=40).map(np.array)
sample_times = st.sampled_from([0.5, 1.0, 10.0])
EFFECTS: dict[str, Behaviour] = {
    "gain": ProcessGain(1.7),
    "delay": ExtraDelay(3.0),
    "part of a sample": ExtraDelay(2.4),
    "less than a sample": ExtraDelay(0.3),
    "pole": ExtraPole(12.0),
    "leak": Leak(0.02),
    "time shift": TimeShift(2.0),
}
every_effect = pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)


def filtered(entry: Filter, values: np.ndarray) -> np.ndarray:
    state, out = np.zeros(len(entry.b)), []
    for value in values.tolist():
        out.append(entry.c @ state + entry.d * value)
        state = entry.a @ state + entry.b * value
    return np.array(out)


@every_effect
@given(values=signals, sample_time=sample_times)
def test_the_filter_is_the_behaviour_from_rest_at_zero(
    effect: Behaviour, values: np.ndarray, sample_time: float
) -> None:
    values[0] = 0.0
    found = filtered(effect.filter(sample_time), values)  # type: ignore[attr-defined]
    assert found == pytest.approx(effect.simulate(values, 0.0, sample_time), abs=1e-9)


@pytest.mark.parametrize(
    "effect", [ProcessGain(1.0), ExtraDelay(0.0), ExtraPole(0.0), Leak(0.0), TimeShift(0.0)]
)
@given(values=signals)
def test_nothing_changes_nothing(effect: Behaviour, values: np.ndarray) -> None:
    assert effect.simulate(values) == pytest.approx(values, abs=1e-9)


@given(signals, numbers, st.integers(0, 8))
def test_a_delay_of_whole_samples_shifts(values: np.ndarray, start: float, delay: int) -> None:
    expected = np.concatenate([np.full(delay, start), values])[: len(values)]
    assert ExtraDelay(float(delay)).simulate(values, start).tolist() == expected.tolist()


@given(signals, numbers)
def test_half_a_sample_lies_between_two(values: np.ndarray, start: float) -> None:
    none, one = ExtraDelay(1.0).simulate(values, start), ExtraDelay(2.0).simulate(values, start)
    assert ExtraDelay(1.5).simulate(values, start) == pytest.approx((none + one) / 2.0)


@given(signals, sample_times, st.floats(0.1, 100.0))
def test_a_pole_is_a_lag(values: np.ndarray, sample_time: float, tau: float) -> None:
    expected = Lag(tau).simulate(values, sample_time=sample_time).tolist()
    assert ExtraPole(tau).simulate(values, sample_time=sample_time).tolist() == expected


@pytest.mark.parametrize("sample_time", [0.5, 2.0])
def test_a_leak_makes_an_integrator_settle(sample_time: float) -> None:
    # K/s becomes K/(s + λ): a constant inflow K ends at K/λ.
    time = np.arange(4000) * sample_time
    level = Leak(0.01).simulate(3.0 * time, sample_time=sample_time)
    assert level[-1] == pytest.approx(3.0 / 0.01, rel=0.02)


def test_a_leak_halves_a_deviation_in_ln2_over_its_rate() -> None:
    level = Leak(np.log(2.0) / 10.0).simulate(np.full(11, 5.0))
    assert (level[0], level[10]) == pytest.approx((5.0, 2.5))


GRIDS: dict[str, tuple[type[Behaviour], list[list[float]]]] = {
    "gain": (ProcessGain, [[0.5], [1.0], [3.0]]),
    "delay": (ExtraDelay, [[0.0], [0.5], [1.0], [4.25]]),
    "pole": (ExtraPole, [[0.0], [0.5], [20.0]]),
    "leak": (Leak, [[0.0], [0.5], [0.01]]),
    "time shift": (TimeShift, [[0.0], [3.0]]),
}


@pytest.mark.parametrize("name", GRIDS)
@given(values=signals, start=numbers, sample_time=sample_times)
def test_a_grid_is_one_simulation_per_row(
    name: str, values: np.ndarray, start: float, sample_time: float
) -> None:
    kind, rows = GRIDS[name]
    timed = {"sample_time": sample_time} if name in ("pole", "leak") else {}
    found = kind.simulate_grid(np.array(rows), values, start, **timed)  # type: ignore[attr-defined]
    assert found.shape == (len(values), len(rows))
    for column, row in zip(found.T, rows, strict=True):
        expected = kind(*row).simulate(values, start, sample_time)
        assert column == pytest.approx(expected, rel=1e-12, abs=1e-9)
