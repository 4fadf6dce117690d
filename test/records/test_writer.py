"""Records that are written are read back digit by digit."""

import dataclasses
import tempfile
from pathlib import Path

import numpy as np
import pytest
from as_given import read_csv
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.errors import InputError
from stiction_ros.records import Record
from stiction_ros.records.csv_writer import write_csv


def record(valves: tuple[str, ...], outputs: tuple[str, ...]) -> Record:
    random = np.random.default_rng(0)
    op, stem = random.random((2, 20, len(valves)))
    pv, sp = random.random((2, 20, len(outputs)))
    return Record("r", 0.5, valves, outputs, op, pv, sp, stem)


def facts(record: Record) -> tuple[object, ...]:
    """Return all that a file keeps of a record, to be compared."""
    signals = [getattr(record, key) for key in ("op", "pv", "sp", "stem")]
    listed = [None if values is None else values.tolist() for values in signals]
    return (record.valves, record.outputs, record.sample_time, record.start, *listed)


NAMES = st.text(
    st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=1, max_size=6
) | st.sampled_from(["OP", "a.PV", "V 1", "t", "1", "a;b;c;d", "a,b", 'say "x"', ".SP", "v1", "V1"])
TAGS = st.lists(NAMES, min_size=1, max_size=3, unique=True).map(tuple)
VALUES = st.floats(-1e12, 1e12)


@st.composite
def records(draw: st.DrawFn) -> Record:
    valves, outputs = draw(TAGS), draw(TAGS)
    count = draw(st.integers(2, 5))
    size = 2 * count * (len(valves) + len(outputs))
    values = np.array(draw(st.lists(VALUES, min_size=size, max_size=size)))
    op, stem, pv, sp = np.split(
        values, np.cumsum([count * len(valves), count * len(valves), count * len(outputs)])
    )
    return Record(
        "r",
        draw(st.sampled_from([0.25, 1.0, 60.0])),
        valves,
        outputs,
        op.reshape(count, -1),
        pv.reshape(count, -1),
        sp.reshape(count, -1) if draw(st.booleans()) else None,
        stem.reshape(count, -1) if draw(st.booleans()) else None,
        draw(st.sampled_from([0.0, 30.5])),
    )


@given(records())
def test_what_is_written_is_read_back_without_naming_a_column(written: Record) -> None:
    with tempfile.TemporaryDirectory() as folder:
        write_csv(written, Path(folder) / "r.csv")
        found = read_csv(Path(folder) / "r.csv")
    assert facts(found) == facts(written)


def test_a_loop_of_one_valve_gets_the_default_names(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    write_csv(record(("V1",), ("PV1",)), path)
    assert path.read_text(encoding="utf-8").splitlines()[0] == "t,OP,PV,SP,STEM"


def test_one_valve_is_chosen_and_the_rest_is_told_by_its_names(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    written = record(("V1", "V2"), ("C", "T"))
    write_csv(written, path)
    found = read_csv(path, op={"V2": "V2.OP"})
    assert (found.valves, found.outputs, found.stem) == (("V2",), ("C", "T"), None)
    assert np.array_equal(found.op[:, 0], written.op[:, 1])


@pytest.mark.parametrize(
    "header",
    [
        "t,A.OP,A.PV,B.OP,B.PV",  # two loops beside each other
        "t,A.PV,A.OP",
        "t,A.OP,C.PV,D.SP",
        "t,A.OP,B.OP,C.PV,B.STEM,A.STEM",
        "t,A.OP,A.OP,C.PV",
        "t,A.OP,C.PV,C.MODE",
        "t,A.op,C.pv",
        "t,.OP,C.PV",
        "t,A.OP,C.SP",
    ],
)
def test_other_names_want_to_be_chosen(tmp_path: Path, header: str) -> None:
    path = tmp_path / "r.csv"
    rows = [f"{k}{',1' * header.count(',')}" for k in range(3)]
    path.write_text("\n".join([header, *rows]), encoding="utf-8")
    with pytest.raises(InputError, match=r"has no columns? OP .*choose with --op TAG=COLUMN"):
        read_csv(path)


def test_what_is_not_known_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    write_csv(dataclasses.replace(record(("V1",), ("PV1",)), sp=None, stem=None), path)
    assert path.read_text(encoding="utf-8").splitlines()[0] == "t,OP,PV"


def test_start_of_the_record_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    write_csv(dataclasses.replace(record(("V1",), ("PV1",)), start=30.0), path)
    assert read_csv(path).start == 30.0


def test_folder_that_is_not_there_is_one_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        write_csv(record(("V1",), ("PV1",)), tmp_path / "no" / "r.csv")
