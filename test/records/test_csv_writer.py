"""A record written as CSV and read again."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stiction_ros.records.csv_file import read_csv
from stiction_ros.records.csv_writer import write_csv
from stiction_ros.records.record import Record

numbers = st.floats(-1e6, 1e6, allow_nan=False)


def made(valves: tuple[str, ...], outputs: tuple[str, ...]) -> Record:
    random = np.random.default_rng(1)
    op, stem = (random.normal(size=(20, len(valves))) for _ in range(2))
    pv, sp = (random.normal(size=(20, len(outputs))) for _ in range(2))
    return Record("made", 2.0, valves, outputs, op, pv, sp, stem)


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rows=st.lists(st.tuples(numbers, numbers), min_size=2, max_size=20))
def test_every_bit_comes_back(tmp_path: Path, rows: list[tuple[float, float]]) -> None:
    table = np.array(rows)
    record = Record("made", 0.5, ("V1",), ("PV1",), table[:, :1], table[:, 1:])
    write_csv(record, tmp_path / "record.csv")
    again = read_csv(tmp_path / "record.csv")
    assert np.array_equal(again.op, record.op)
    assert np.array_equal(again.pv, record.pv)
    assert again.sample_time == pytest.approx(0.5)
    assert (again.sp, again.stem) == (None, None)


def test_one_loop_gets_the_default_columns(tmp_path: Path) -> None:
    record = made(("V1",), ("PV1",))
    write_csv(record, tmp_path / "record.csv")
    assert (tmp_path / "record.csv").read_text().splitlines()[0] == "t,OP,PV,SP,STEM"
    again = read_csv(tmp_path / "record.csv")
    assert again.sp is not None
    assert again.stem is not None
    assert np.array_equal(again.sp, record.sp)
    assert np.array_equal(again.stem, record.stem)


def test_several_valves_are_told_apart(tmp_path: Path) -> None:
    record = made(("V1", "V2"), ("C", "T"))
    write_csv(record, tmp_path / "record.csv")
    names = ["V1.OP", "V2.OP", "C.PV", "T.PV", "C.SP", "T.SP", "V1.STEM", "V2.STEM"]
    assert (tmp_path / "record.csv").read_text().splitlines()[0].split(",") == ["t", *names]
    again = read_csv(
        tmp_path / "record.csv",
        op={"V1": "V1.OP", "V2": "V2.OP"},
        pv={"C": "C.PV", "T": "T.PV"},
    )
    assert np.array_equal(again.op, record.op)
    assert np.array_equal(again.pv, record.pv)


def test_unknown_signals_are_left_out(tmp_path: Path) -> None:
    record = dataclasses.replace(made(("V1",), ("PV1",)), sp=None, stem=None)
    write_csv(record, tmp_path / "record.csv")
    assert (tmp_path / "record.csv").read_text().splitlines()[0] == "t,OP,PV"
