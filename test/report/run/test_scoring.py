import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.records.record import Record
from stiction_ros.report.run.scoring import PhaseStatus, iae_per_hour, offset, phases, score
from stiction_ros.signals.holds import holds
from stiction_ros.signals.oscillation import amplitude, dominant_cycle

ROUND = 400


def schedule(rounds: int) -> np.ndarray:
    one = np.repeat([10.0, 12.0], ROUND // 2)
    return np.tile(one, rounds)[:, None]


def loop(error: np.ndarray, sp: np.ndarray) -> Record:
    return Record("loop", 30.0, ("V1",), ("PV1",), np.zeros((len(sp), 1)), sp + error, sp)


def wave(size: float, period: float, samples: int, phase: float = 0.3) -> np.ndarray:
    return size * np.sin(2 * np.pi * np.arange(samples) / period + phase)


@given(
    size=st.floats(0.05, 5.0),
    period=st.floats(12.0, 70.0),
    phase=st.floats(0.0, 6.28),
    bias=st.floats(-3.0, 3.0),
    seed=st.integers(0, 1000),
)
def test_the_amplitude_of_a_sine_in_noise_is_recovered(
    size: float, period: float, phase: float, bias: float, seed: int
) -> None:
    noise = 0.1 * size * np.random.default_rng(seed).standard_normal(600)
    error = bias + wave(size, period, 600, phase) + noise
    found = amplitude(error, [(0, 200), (200, 400), (400, 600)], period)
    assert found == pytest.approx(size, rel=0.06)


def test_noise_alone_has_nearly_no_line() -> None:
    error = np.random.default_rng(1).standard_normal(600)
    assert amplitude(error, [(0, 300), (300, 600)], 40.0) < 0.25


def test_a_settling_transient_is_left_out() -> None:
    error = 5.0 * np.exp(-np.arange(200) / 4.0)
    assert amplitude(error, [(0, 200)], 40.0) < 0.01


def test_a_hold_too_short_for_one_period_says_nothing() -> None:
    assert amplitude(wave(1.0, 40.0, 50), [(0, 50)], 40.0) is None
    both = amplitude(wave(1.0, 40.0, 250), [(0, 50), (50, 250)], 40.0)
    assert both == pytest.approx(1.0, rel=1e-6)


@given(bias=st.floats(-5.0, 5.0))
def test_offset_is_the_mean_error_at_the_end_of_holds(bias: float) -> None:
    error = np.full(400, bias)
    error[:100] += 7.0  # a transient that is over before the last 50 samples
    assert offset(error, [(0, 200), (200, 400)]) == pytest.approx(abs(bias), abs=1e-12)


def test_offsets_of_opposite_sign_do_not_cancel_and_short_holds_do_not_count() -> None:
    error = np.concatenate([np.full(30, 9.0), np.full(200, 1.0), np.full(200, -1.0)])
    assert offset(error, [(0, 30), (30, 230), (230, 430)]) == pytest.approx(1.0)
    assert offset(np.full(30, 9.0), [(0, 30)]) == pytest.approx(9.0)


@given(sigma=st.floats(0.01, 3.0), seed=st.integers(0, 100))
def test_noise_alone_costs_no_iae(sigma: float, seed: int) -> None:
    error = sigma * np.random.default_rng(seed).standard_normal(5000)
    assert iae_per_hour(error, sigma) == pytest.approx(0.0, abs=0.05 * sigma)


def test_iae_per_hour_does_not_depend_on_the_sample_time() -> None:
    assert iae_per_hour(np.full(7, -2.0)) == pytest.approx(2.0)
    assert iae_per_hour(wave(1.0, 50.0, 5000)) == pytest.approx(2 / np.pi, rel=1e-3)


def test_holds() -> None:
    assert holds(schedule(3))[:3] == [(0, 200), (200, 400), (400, 600)]


@settings(max_examples=20)
@given(period=st.floats(15.0, 60.0), seed=st.integers(0, 100))
def test_the_dominant_period_is_found(period: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    clear = np.sign(wave(1.0, period, 800)) + 0.3 * rng.standard_normal(800)
    vague = 0.2 * wave(1.0, period, 800) + rng.standard_normal(800)
    found = dominant_cycle(np.column_stack([vague, clear]), [(0, 200), (200, 500), (500, 800)])
    assert found is not None
    assert found.period == pytest.approx(period, rel=0.03)
    assert found.output == 1
    assert found.share > 0.5
    assert found.count == pytest.approx(800 / period, rel=0.2, abs=2.5)


def test_the_swap_ends_a_cycle() -> None:
    sp = schedule(4)
    error = wave(0.5, 40.0, len(sp))[:, None]
    error[900:] *= 0.1
    found = phases(loop(error, sp), 900, ROUND)
    assert found.status is PhaseStatus.OK
    assert found.cycle is not None
    assert found.cycle.period == pytest.approx(40.0, rel=0.02)
    assert found.before is not None
    assert found.after is not None
    assert (found.before.first, found.before.last) == (400, 800)
    assert (found.after.first, found.after.last) == (1200, 1600)
    assert found.before.scores["PV1"].amplitude == pytest.approx(0.5, rel=0.02)
    assert found.after.scores["PV1"].amplitude == pytest.approx(0.05, rel=0.02)


def test_a_swap_at_the_start_of_a_round_uses_this_round() -> None:
    sp = schedule(3)
    found = phases(loop(wave(0.5, 40.0, len(sp))[:, None], sp), 2 * ROUND, ROUND)
    assert found.before is not None
    assert found.after is not None
    assert (found.before.first, found.after.first) == (400, 800)


@pytest.mark.parametrize(
    ("error", "swap", "status", "says"),
    [
        (np.random.default_rng(3).standard_normal(1600), 900, PhaseStatus.NO_CYCLE, "not cycle"),
        (wave(0.5, 150.0, 1600), 900, PhaseStatus.NO_CYCLE, "2 whole cycles"),
        (wave(0.5, 40.0, 1600), 300, PhaseStatus.NO_ROUND, "first round"),
        (wave(0.5, 40.0, 1600), 1300, PhaseStatus.NO_ROUND, "record ends"),
        (wave(0.5, 40.0, 1600), None, PhaseStatus.NO_SWAP, "never"),
    ],
)
def test_why_phases_cannot_be_compared(
    error: np.ndarray, swap: int | None, status: PhaseStatus, says: str
) -> None:
    found = phases(loop(error[:, None], schedule(4)), swap, ROUND)
    assert found.status is status
    assert says in found.reason


def test_without_set_points_deviations_from_the_mean_are_scored() -> None:
    pv = 70.0 + wave(1.0, 40.0, 400)[:, None]
    record = Record("loop", 1.0, ("V1",), ("PV1",), np.zeros((400, 1)), pv)
    scores = score(record, 0, 400, 40.0, [0.0]).scores["PV1"]
    assert scores.amplitude == pytest.approx(1.0, rel=0.02)
    assert scores.iae_per_hour == pytest.approx(2 / np.pi, rel=0.02)
