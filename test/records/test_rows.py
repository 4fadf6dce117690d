"""A row is a sample: its values stay together, whatever its stamp is."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from stiction_ros.records.record import Record
from stiction_ros.records.whole import Whole


def read(times: np.ndarray, op: np.ndarray, pv: np.ndarray) -> Record:
    said = "loop", "loop.csv", lambda row: f"row {row}"
    signals = {"op": op[:, None], "pv": pv[:, None]}
    (record,) = Whole(*said, ("V",), ("P",), times, 0.0, signals).records()
    return record


def kept(times: np.ndarray, places: np.ndarray) -> Record:
    """Read rows, each with values of its own; every row is found at its place."""
    random = np.random.default_rng(len(times))
    op, pv = random.permutation(len(times)), random.permutation(len(times)) + 0.5
    record = read(times, op, pv)
    assert len(record) == places[-1] - places[0] + 1
    measured = np.flatnonzero(record.measured)
    np.testing.assert_array_equal(measured, places - places[0])
    np.testing.assert_array_equal(record.op[measured, 0], op)
    np.testing.assert_array_equal(record.pv[measured, 0], pv)
    mean = (times[-1] - times[0]) / (places[-1] - places[0])
    # The mean of few rows is off by what their first and last are late.
    assert record.sample_time == pytest.approx(mean, rel=max(1e-3, 0.5 / len(times)))
    return record


counts = st.integers(300, 1500)
seeds = st.integers(0, 2**31)
jitters = st.floats(0.0, 0.25)
scans = st.sampled_from([0.0125, 0.5, 1.0, 5.0, 7.3, 60.0])


def places_with_holes(count: int, missing: int, random: np.random.Generator) -> np.ndarray:
    return np.delete(np.arange(count), random.choice(np.arange(1, count - 1), missing, False))


@given(counts, scans, jitters, st.integers(0, 4), seeds)
def test_rows_that_jitter_about_their_time(
    count: int, scan: float, jitter: float, missing: int, seed: int
) -> None:
    random = np.random.default_rng(seed)
    places = places_with_holes(count, missing, random)
    # A sample time from so few rows is off by their own jitter: 0.5 / 300 of it.
    kept(scan * (places + 0.98 * random.uniform(-jitter, jitter, len(places))), places)


@given(counts, scans, jitters, st.integers(0, 4), seeds)
def test_rows_whose_steps_jitter(
    count: int, scan: float, jitter: float, missing: int, seed: int
) -> None:
    random = np.random.default_rng(seed)
    places = places_with_holes(count, missing, random)
    steps = 1.0 + 0.9 * random.uniform(-jitter, jitter, count)
    kept(scan * np.cumsum(steps)[places], places)


@given(counts, scans, jitters)
def test_a_scan_that_alternates(count: int, scan: float, jitter: float) -> None:
    places = np.arange(count)
    kept(scan * np.cumsum(np.where(places % 2, 1.0 + jitter, 1.0 - jitter)), places)


@given(counts, scans, st.integers(1, 10), st.floats(0.05, 0.7), st.integers(0, 4), seeds)
def test_rows_that_come_late(
    count: int, scan: float, late: int, by: float, missing: int, seed: int
) -> None:
    random = np.random.default_rng(seed)
    places = places_with_holes(count, missing, random)
    times = places.astype(float)
    inside = np.flatnonzero((np.diff(places)[1:] == 1) & (np.diff(places)[:-1] == 1)) + 1
    times[random.choice(inside[::3], late, False)] += by
    kept(scan * times, places)


def test_rows_that_come_late_together() -> None:
    times = np.arange(300.0)
    times[100:104] = 103.7 + 0.05 * np.arange(4)
    kept(times, np.arange(300))


@given(st.integers(1000, 1500), st.floats(1.03, 1.7), st.sampled_from([0.01, 1.0, 60.0]), seeds)
def test_stamps_with_too_few_digits(count: int, scan: float, digit: float, seed: int) -> None:
    places = np.arange(count)
    offset = np.random.default_rng(seed).uniform()
    record = kept(digit * np.floor(scan * places + offset), places)
    assert record.notes[0].startswith("stamps are rounded") or scan > 1.9


@given(st.sampled_from([1.1, 1.25, 1.3, 1.6, 2.3]), st.integers(1, 3), seeds)
def test_missing_rows_among_stamps_with_too_few_digits(
    scan: float, missing: int, seed: int
) -> None:
    random = np.random.default_rng(seed)
    places = places_with_holes(1500, missing, random)
    holes = np.flatnonzero(np.diff(places) > 1)
    assume(holes[0] > 20 and holes[-1] < 1450 and (np.diff(holes) > 20).all())
    record = read(np.floor(scan * places), places.astype(float), 2.0 * places)
    assert len(record) == 1500
    np.testing.assert_array_equal(2.0 * record.op[record.measured], record.pv[record.measured])


@given(counts, st.integers(4, 25), seeds)
def test_missing_rows_alone_are_no_rounding(count: int, missing: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    places = places_with_holes(count, missing, random)
    long = np.flatnonzero(np.diff(places) > 1)
    assume(np.ptp(np.diff(long)) > 6)  # rows missing as evenly as rounding would have it
    kept(places.astype(float), places)
