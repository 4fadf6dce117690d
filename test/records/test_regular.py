from pathlib import Path

import numpy as np
import pytest
from as_given import read_csv_parts
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.errors import InputError
from stiction_ros.records.record import Record
from stiction_ros.records.regular import split_at_gaps


def parts_of(tmp_path: Path, times: np.ndarray, **columns: np.ndarray) -> tuple[Record, ...]:
    """Write PV = 2 t + 1, OP = number of the row, and read it."""
    path = tmp_path / "loop.csv"
    signals = {"OP": np.arange(len(times)), "PV": 2.0 * times + 1.0} | columns
    rows = np.column_stack([times, *signals.values()])
    lines = [",".join(repr(float(v)) for v in row) for row in rows]
    path.write_text("\n".join([",".join(["t", *signals]), *lines]))
    return read_csv_parts(path)


def test_a_regular_record_is_left_alone(tmp_path: Path) -> None:
    (record,) = parts_of(tmp_path, np.arange(10.0))
    assert record.notes == ()
    assert record.op[:, 0].tolist() == list(range(10))


def test_jitter_is_told(tmp_path: Path) -> None:
    times = np.arange(200.0) + np.random.default_rng(3).uniform(-0.3, 0.3, 200)
    (record,) = parts_of(tmp_path, times)
    assert record.sample_time == pytest.approx(1.0, abs=0.01)
    (note,) = record.notes
    assert note == "sample times jitter by up to 58%, taken as regular, 1 s"


def test_single_missing_rows_are_filled_and_counted(tmp_path: Path) -> None:
    times = np.delete(np.arange(100.0), [20, 50, 51])
    (record,) = parts_of(tmp_path, times)
    assert len(record) == 100
    np.testing.assert_allclose(record.pv[:, 0], 2.0 * np.arange(100.0) + 1.0, rtol=1e-12)
    assert record.op[20, 0] == record.op[19, 0]
    assert record.notes == ("3 samples held over at most 5 in a row (PV interpolated)",)


def test_a_gap_splits(tmp_path: Path) -> None:
    times = np.concatenate([np.arange(50.0), 80.0 + np.arange(30.0), 200.0 + np.arange(20.0)])
    parts = parts_of(tmp_path, times)
    assert [(len(p), p.start) for p in parts] == [(50, 0.0), (30, 80.0), (20, 200.0)]
    assert parts[1].op[0, 0] == 50.0
    assert all("split at 2 gaps" in p.notes for p in parts)


def test_a_row_alone_between_two_gaps_is_left_out_and_told(tmp_path: Path) -> None:
    times = np.concatenate([np.arange(50.0), [75.0], 100.0 + np.arange(30.0)])
    parts = parts_of(tmp_path, times)
    assert [len(p) for p in parts] == [50, 30]
    assert "1 rows alone between two gaps left out" in parts[0].notes


def test_what_is_more_than_slightly_irregular_is_refused(tmp_path: Path) -> None:
    steps = np.random.default_rng(0).choice([1.0, 2.0, 5.0], 300)
    with pytest.raises(InputError, match="time is irregular at line"):
        parts_of(tmp_path, steps.cumsum())


times = st.lists(st.floats(0.01, 20.0), min_size=1, max_size=60).map(
    lambda steps: np.concatenate([[0.0], np.cumsum(steps)])
)


@given(times)
def test_stretches_cover_every_row_once(times: np.ndarray) -> None:
    edges = split_at_gaps(times)
    assert [row for first, last in edges for row in range(first, last)] == list(range(len(times)))
