"""Records from arrays and data frames."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros import CsvColumns, InputError, Record, read

COUNT = 60
RANDOM = np.random.default_rng(3)
OP = 50.0 + RANDOM.normal(size=COUNT).cumsum()
PV = RANDOM.normal(size=COUNT)
STAMPS = np.datetime64("2024-05-01T10:00:00") + np.timedelta64(5, "s") * np.arange(COUNT)


class Frame(dict[str, Any]):
    """What of a DataFrame is used: columns by name, and an index."""

    def __init__(self, columns: dict[str, Any], index: Any) -> None:
        super().__init__(columns)
        self.columns, self.index = list(columns), index


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(4, 40),
    valves=st.integers(1, 3),
    outputs=st.integers(1, 2),
    step=st.floats(1e-3, 1e4),
    start=st.sampled_from([0.0, -7.0, 1.7e9]),
)
def test_arrays_come_back_as_they_were(
    seed: int, count: int, valves: int, outputs: int, step: float, start: float
) -> None:
    random = np.random.default_rng(seed)
    op = random.uniform(20.0, 80.0, (count, valves))
    pv, sp = random.uniform(-1.0, 1.0, (2, count, outputs))
    record = Record.from_arrays(step, op, pv, sp)
    assert record.sample_time == step
    assert record.notes == ()
    for found, put in ((record.op, op), (record.pv, pv), (record.sp, sp)):
        assert np.array_equal(np.asarray(found), put)
    step = round(step, 3)
    again = Record.from_arrays(start + step * np.arange(count), record.op, record.pv, record.sp)
    assert again.sample_time == pytest.approx(step, rel=1e-3)
    assert again.start == start
    assert np.array_equal(again.pv, pv)


def test_plain_vectors_and_one_column_are_the_same() -> None:
    flat, wide = Record.from_arrays(5.0, OP, PV), Record.from_arrays(5, OP[:, None], PV[:, None])
    assert np.array_equal(flat.op, wide.op)
    assert (flat.valves, flat.outputs, flat.sp) == (("V1",), ("PV1",), None)
    named = Record.from_arrays(5.0, OP, PV, PV, stem=OP, valves=["FV1"], outputs=["FT1"], name="x")
    assert (named.valves, named.outputs, named.name) == (("FV1",), ("FT1",), "x")
    assert np.array_equal(np.asarray(named.stem), named.op)


@pytest.mark.parametrize(
    "time", [STAMPS, STAMPS.astype(str).tolist(), STAMPS.tolist(), 1714557600 + 5 * np.arange(60)]
)
def test_dates_are_times(time: Any) -> None:
    record = Record.from_arrays(time, OP, PV)
    assert (record.start, record.sample_time) == (1714557600.0, 5.0)


def test_what_is_irregular_missing_or_lost_is_treated_as_in_a_file(tmp_path: Path) -> None:
    time = 5.0 * np.arange(COUNT) + RANDOM.uniform(-0.5, 0.5, COUNT)
    time[40:] += 500.0
    op = OP.copy()
    op[10] = np.nan
    rows = np.column_stack([time, op, PV]).tolist()
    lines = [",".join(map(repr, row)) for row in rows]
    file = tmp_path / "f.csv"
    file.write_text("\n".join(["t,op,pv", *lines]).replace("nan", ""))
    columns = CsvColumns(op={"V1": "op"}, pv={"PV1": "pv"})
    wanted = read(file, columns)
    frame = Frame({"op": op, "pv": PV}, time)
    for found in (Record.from_arrays(time, op, PV), Record.from_dataframe(frame, "op", "pv")):
        assert np.array_equal(found.op, wanted.op)
        assert np.array_equal(found.pv, wanted.pv)
        assert np.array_equal(found.quality, wanted.quality)
        assert (found.start, found.sample_time) == (wanted.start, wanted.sample_time)
        assert [n.replace("V1.OP", "op") for n in found.notes] == list(wanted.notes)
    assert len(wanted.notes) > 3


def test_an_index_of_dates_durations_or_seconds_is_the_time() -> None:
    columns = {"valve": OP.astype(object), "flow": PV}
    for index in (STAMPS, STAMPS - STAMPS[0], 5.0 * np.arange(COUNT)):
        record = Record.from_dataframe(Frame(columns, index), "valve", {"FT1": "flow"})
        assert (record.sample_time, record.outputs) == (5.0, ("FT1",))
        assert np.array_equal(record.op[:, 0], OP)
    rows = Frame(columns, np.arange(COUNT))
    with pytest.raises(InputError, match=r"no column t; .*with sample_time S"):
        Record.from_dataframe(rows, "valve", "flow")
    assert Record.from_dataframe(rows, "valve", "flow", sample_time=2.0).sample_time == 2.0
    assert Record.from_dataframe(rows, "valve", "flow", time=STAMPS).start == 1714557600.0


def test_a_mode_counts_as_in_a_file() -> None:
    mode = ["AUTO"] * 40 + ["MAN"] * 20
    frame = {"time": 5.0 * np.arange(COUNT), "op": OP, "pv": PV, "mode": mode}
    assert len(Record.from_dataframe(frame, "op", "pv")) == 40
    assert len(Record.from_dataframe(frame, "op", "pv", automatic="MAN")) == 20


def test_another_unit_of_op_is_said() -> None:
    with pytest.raises(InputError, match="op_unit share or op_unit percent"):
        Record.from_arrays(1.0, np.clip(OP / 100.0, 0.0, 1.0), PV)
    share = Record.from_arrays(1.0, np.clip(OP / 100.0, 0.0, 1.0), PV, op_unit="share")
    assert np.allclose(share.op[:, 0], OP)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((1.0, OP[None], PV), r"op: shape \(1, 60\) does not fit .*; give op.T"),
        ((STAMPS, OP[None], PV), r"op: shape \(1, 60\) .*; give op.T"),
        ((1.0, OP, PV[1:]), r"pv: shape \(59, 1\) does not fit 60 samples"),
        ((1.0, OP, None), r"pv: shape \(\) does not fit 60 samples, one a row, of 1 signal"),
        ((0.0, OP, PV), "time: 0.0 is neither times nor a positive sample time"),
        (("t", OP, PV), "time: 't' is neither"),
        ((1.0, OP, [[1.0], [2.0, 3.0]]), "pv: cannot be read"),
        ((1.0, OP, np.full(COUNT, np.nan)), "PV1.PV holds no number"),
        ((1.0, OP, PV, np.c_[PV, PV]), r"sp: shape \(60, 2\) .* of 1 signal"),
        ((1.0, OP, OP), "one signal is given twice"),
        (([], [], []), "0 rows of data"),
    ],
)
def test_wrong_arrays_get_a_sentence(given: tuple[Any, ...], told: str) -> None:
    with pytest.raises(InputError, match=told) as error:
        Record.from_arrays(*given)
    assert "--" not in str(error.value)


@pytest.mark.parametrize(
    ("frame", "told"),
    [
        ({"OP": OP, "flow": PV}, "op: unknown column 'op'; use OP | flow; did you mean OP?"),
        ({"op": OP, "flow": PV[1:]}, "columns differ in length"),
        ({"op": OP, "flow": PV, "t": ["foo"] * COUNT}, "60 stamps of 60 not understood"),
        (OP, "ndarray has no columns"),
        (None, "NoneType has no columns"),
    ],
)
def test_wrong_frames_get_a_sentence(frame: Any, told: str) -> None:
    with pytest.raises(InputError, match=told.replace("|", r"\|")) as error:
        Record.from_dataframe(frame, "op", "flow")
    assert "--" not in str(error.value)


def test_set_points_are_those_of_the_outputs() -> None:
    with pytest.raises(InputError, match="record: sp names PV2; it needs one column for each of"):
        Record.from_dataframe({"t": STAMPS, "op": OP, "pv": PV}, "op", "pv", {"PV2": "pv"})


def test_frames_of_pandas_are_read() -> None:
    pandas = pytest.importorskip("pandas")
    index = pandas.DatetimeIndex(STAMPS, tz="UTC")
    frame = pandas.DataFrame({"op": OP, "pv": PV}, index=index).convert_dtypes()
    frame.loc[index[7], "pv"] = pandas.NA
    record = Record.from_dataframe(frame, "op", "pv")
    assert (record.start, record.sample_time) == (1714557600.0, 5.0)
    assert [note.partition(":")[0] for note in record.notes[:1]] == ["pv"]
    again = Record.from_arrays(index, frame["op"], frame[["op", "pv"]].fillna(0.0) + 1.0)
    assert again.pv.shape == (COUNT, 2)
