"""A sensor that repeats its value is not taken for a stem that rests."""

import dataclasses

import numpy as np
import pytest
from evidence_loops import pi_loop
from hypothesis import assume, given
from hypothesis import strategies as st

from stiction_ros.identification import IdentificationOptions, VerdictKind, identify
from stiction_ros.identification.evidence.sensor_hold import held_rows, refresh, restored
from stiction_ros.records.record import Record


def frozen(record: Record, seed: int) -> Record:
    """Return the record with 10 to 40 samples of PV held at random times."""
    random, pv = np.random.default_rng(seed), record.pv.copy()
    for row in random.integers(50, len(pv) - 50, len(pv) // 80):
        pv[row : row + int(random.integers(10, 41))] = pv[row]
    return dataclasses.replace(record, pv=pv)


@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 1e3))
def test_rounding_alone_holds_nothing(seed: int, step: float) -> None:
    walk = np.cumsum(np.random.default_rng(seed).uniform(-0.4, 0.4, 300))
    assert not held_rows(step * np.round(walk)).any()


@given(st.integers(0, 2**32 - 1), st.floats(0.6, 2.0), st.integers(40, 80))
def test_a_rounded_value_that_noise_would_have_changed_was_not_read(
    seed: int, noise: float, length: int
) -> None:
    values = np.round(np.random.default_rng(seed).normal(0.0, noise, 200))
    values[60 : 60 + length] = values[60]
    assert held_rows(values)[61 : 60 + length].all()


def test_a_ramp_elsewhere_does_not_hide_it() -> None:
    found = 0
    for seed in range(40):
        values = np.random.default_rng(seed).normal(0.0, 0.8, 200)
        values[150:] += 1.5 * np.arange(50)
        values = np.round(values)
        values[60:100] = values[60]
        found += bool(held_rows(values)[61:100].all())
    assert found >= 36


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_all_repeats_of_a_pv_that_is_not_rounded_are_held(seed: int, length: int) -> None:
    values = np.cumsum(np.random.default_rng(seed).normal(0.0, 1e-3, 100)) + np.arange(100)
    values[-length:] = values[-length]
    assert held_rows(values).sum() == length - 1


@given(st.integers(0, 2**32 - 1), st.floats(0.5, 1.0))
def test_a_sensor_that_reports_by_exception_holds_until_it_reports(seed: int, width: float) -> None:
    walk = np.cumsum(np.random.default_rng(seed).uniform(-0.4, 0.4, 300))
    read = np.empty_like(walk)
    last = walk[0]
    for row, value in enumerate(walk):
        last = value if abs(value - last) > width else last
        read[row] = last
    reports = np.flatnonzero(np.diff(read)) + 1
    assume(len(reports) > 20)  # of fewer the least difference may be as long as a jump
    end = reports[-1]
    repeats = np.append(False, np.diff(read) == 0.0)[:end]
    assert (held_rows(read)[:end] == repeats).all()


@given(st.integers(0, 2**32 - 1), st.integers(2, 12), st.integers(0, 11))
def test_a_regular_refresh_is_seen(seed: int, step: int, first: int) -> None:
    values = np.random.default_rng(seed).standard_normal(40)
    pv = np.repeat(values, step)[first % step :]
    record = Record("wireless", 1.0, ("V1",), ("PV1",), np.ones((len(pv), 1)), pv[:, None])
    assert refresh(record) == (step, (step - first % step) % step)


@given(st.integers(0, 2**32 - 1))
def test_what_was_measured_stays(seed: int) -> None:
    record = frozen(pi_loop(2.0, 1.0, samples=400), seed)
    held = held_rows(record.pv[:, 0])
    mended = restored(record, IdentificationOptions())
    assert held.any()
    assert np.array_equal(mended.pv[~held], record.pv[~held])


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.trial)])
def test_a_sensor_that_freezes_makes_no_friction(seed: int) -> None:
    found = identify(frozen(pi_loop(0.0, 0.0, seed=seed), seed))
    assert not found.valves[0].verdict.has_friction
    assert any("measurement PV1 was stale for" in note for note in found.notes)


@pytest.mark.trial
def test_friction_is_found_behind_a_wireless_sensor() -> None:
    record = pi_loop(3.0, 1.0, samples=3000, noise=0.1)
    pv = np.repeat(record.pv[::6], 6, axis=0)[: len(record)]
    valve = identify(dataclasses.replace(record, pv=pv)).valves[0]
    assert valve.verdict is VerdictKind.STICKY
    assert valve.static_interval[0] <= 3.0 <= valve.static_interval[1]
