import datetime
import gzip
import tempfile
from pathlib import Path

import numpy as np
import pytest
from as_given import open_record, read_csv
from hypothesis import assume, example, given
from hypothesis import strategies as st

from stiction_ros.errors import InputError
from stiction_ros.intake import IntakeOptions, loops
from stiction_ros.intake.intake_options import OpUnit, TimeUnit
from stiction_ros.intake.repairs import SENTINELS
from stiction_ros.records.record import Record

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


def test_a_loop_that_cannot_be_read_stops_no_other(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,OP,PV\n0,1,2\n1,1,3\n2,2,3\n")
    (tmp_path / "b.csv").write_text("t,OP\n0,1\n1,1\n")
    (tmp_path / "c.csv").write_text("t,OP,PV\n0,1,2\n1,1,3\n2,2,3\n")
    found = list(loops([tmp_path], IntakeOptions()))
    assert [loop.name for loop in found] == ["a", "b", "c"]
    assert found[1].problem is not None
    assert "has no column PV" in found[1].problem
    assert found[1].parts == ()
    assert [len(part) for part in found[2].parts] == [3]
    assert found[0].files == (tmp_path / "a.csv",)


def test_no_name_comes_twice(tmp_path: Path) -> None:
    for folder in ("north", "south", "x/south"):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        (tmp_path / folder / "FIC1.csv").write_text("t,OP,PV\n0,1,2\n1,1,3\n2,2,3\n")
    found = [loop.name for loop in loops([tmp_path], IntakeOptions())]
    assert found == ["FIC1", "FIC1 (south)", "FIC1 (south 2)"]


NAMES = [
    "time",
    "t",
    "t_ms",
    "date",
    "OP",
    "PV",
    "SP",
    "MODE",
    "F1.OP",
    "F1.PV",
    "F1.MODE",
    "F2.OP",
]
NAMES += ["tag", "value", "quality", "QUALITY", "F1.PV [%]", "", "OP (mA)", "F2.PV.Quality"]
CELLS = ["0", "1", "2", "0.5", "1e300", "-9999", "nan", "inf", "Bad", "", "AUTO", "MAN", "good"]
CELLS += ["2024-10-17 21:55:00", "01/02/2024 3:04 PM", "17-Oct-24 21:55", "1.7e12", "1,5", "F1.OP"]
CELLS += ["F1.PV", "bad", "held", "192", "9" * 400, "99/99/9999 99:99", "24:00", "1e-320", "-0"]


def outcomes(content: bytes, suffix: str, options: IntakeOptions) -> None:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / f"a{suffix}").write_bytes(content)
        for loop in loops([Path(folder)], options):
            assert (loop.problem is None) == bool(loop.parts)
            assert len(loop.summary.splitlines()) == 1


@example(
    header=["OP", "PV"],
    body=[["0"], ["0", "F1.OP"], ["0", "F1.OP"]],
    regular=True,
    options=IntakeOptions(),
)
@given(
    header=st.lists(st.sampled_from(NAMES), min_size=1, max_size=6),
    body=st.lists(st.lists(st.sampled_from(CELLS), min_size=1, max_size=6), max_size=30),
    regular=st.booleans(),
    options=st.sampled_from(
        [
            IntakeOptions(),
            IntakeOptions(strict=True),
            IntakeOptions(sample_time=2.0),
            IntakeOptions(op_unit=OpUnit.SHARE, time_unit=TimeUnit.MILLISECONDS),
            IntakeOptions(automatic=("1",), op_unit=OpUnit.OTHER),
        ]
    ),
)
def test_any_table_is_loops_or_one_clear_line_each(
    header: list[str], body: list[list[str]], regular: bool, options: IntakeOptions
) -> None:
    rows = [[str(k), *row] for k, row in enumerate(body)] if regular else body
    names = ["t", *header] if regular else header
    text = "\n".join(";".join(row) for row in [names, *rows])
    outcomes(text.encode(), ".csv", options)


@given(st.binary(max_size=300), st.sampled_from([".csv", ".gz", ".zst", ".xlsx", ".parquet"]))
def test_any_bytes_are_loops_or_one_clear_line_each(content: bytes, suffix: str) -> None:
    for start in (
        b"",
        b"\xff\xfe",
        b"t,OP,PV\n0,1,2\n",
        b"PAR1",
        b"PK\x03\x04",
        b"\x28\xb5\x2f\xfd",
    ):
        outcomes(start + content, suffix, IntakeOptions())
    outcomes(gzip.compress(content)[:-3], suffix, IntakeOptions())


def read(tmp_path: Path, text: str, **options: object) -> Record:
    path = tmp_path / "loop.csv"
    path.write_text(text, encoding="utf-8")
    return read_csv(path, **options)  # type: ignore[arg-type]


def test_default_columns(tmp_path: Path) -> None:
    record = read(tmp_path, "t,OP,PV,SP,STEM,MODE\n0,1,2,3,4,Auto\n2,5,6,7,8,\n")
    assert (record.sample_time, record.valves, record.outputs) == (2.0, ("V1",), ("PV1",))
    assert record.op.tolist() == [[1.0], [5.0]]
    assert record.pv.tolist() == [[2.0], [6.0]]
    assert record.sp is not None
    assert record.sp.tolist() == [[3.0], [7.0]]
    assert record.stem is not None
    assert record.stem.tolist() == [[4.0], [8.0]]
    assert record.notes == ()


def test_optional_columns_and_case(tmp_path: Path) -> None:
    record = read(tmp_path, "\ufeff Time , op ,pv\r\n10,1,2\r\n10.5,1,2\r\n\r\n")
    assert record.sp is None
    assert record.stem is None
    assert (record.sample_time, record.start) == (0.5, 10.0)


def test_mapping_of_several_valves(tmp_path: Path) -> None:
    record = read(
        tmp_path,
        "s,a,b,y,z,SP\n0,1,2,3,4,0\n1,1,2,3,4,0\n",
        op={"V1": "a", "V2": "b"},
        pv={"C": "y", "T": "z"},
        sp={"T": "z", "C": "y"},
        time="s",
    )
    assert record.op.tolist()[0] == [1.0, 2.0]
    assert record.valves == ("V1", "V2")
    assert record.sp is not None
    assert record.sp.tolist()[0] == [3.0, 4.0]
    mapped = read(tmp_path, "t,OP,y,SP\n0,1,2,3\n1,1,2,3\n", pv={"F": "y"})
    assert mapped.sp is None


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_semicolons_and_tabs_may_bring_decimal_commas(tmp_path: Path, delimiter: str) -> None:
    text = "t,OP,PV\n0,1:5,2\n1,1.5,-2:25e1\n".replace(",", delimiter).replace(":", ",")
    record = read(tmp_path, text)
    assert record.op.tolist() == [[1.5], [1.5]]
    assert record.pv[1, 0] == -22.5


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("2024-10-17 21:55:00", "2024-10-17 21:55:10"),
        ("2024-10-17T21:55:00.5Z", "2024-10-17T21:55:10.500Z"),
        ("2024-10-17T23:55:00+02:00", "2024-10-17T21:55:10+00:00"),
    ],
)
def test_iso_stamps(tmp_path: Path, first: str, second: str) -> None:
    record = read(tmp_path, f"time,OP,PV\n{first},1,2\n{second},1,2\n")
    begin = datetime.datetime(2024, 10, 17, 21, 55, tzinfo=datetime.UTC).timestamp()
    assert record.sample_time == 10.0
    assert abs(record.start - begin) <= 0.5


@given(
    st.lists(
        st.tuples(*[st.floats(-1e300, 1e300).filter(lambda value: value not in SENTINELS)] * 3),
        min_size=2,
        max_size=40,
    ),
    st.sampled_from([0.1, 0.25, 1.0, 10.0, 1 / 3]),
    st.sampled_from([0.0, 1000.0, 1.7e9]),
    st.sampled_from([",", ";", "\t"]),
)
def test_round_trip(  # differences of values are finite
    rows: list[tuple[float, float, float]], step: float, start: float, delimiter: str
) -> None:
    assume(any(op != pv for _, op, pv in rows))  # one signal given twice is refused
    lines = [["t", "SP", "OP", "PV"]]
    lines += [
        [repr(start + k * step), *(repr(value) for value in row)] for k, row in enumerate(rows)
    ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.csv"
        path.write_text("\n".join(delimiter.join(line) for line in lines))
        record = open_record(path)
    assert abs(record.sample_time - step) * (len(rows) - 1) <= 1e-4 * step
    assert record.start == start
    assert record.sp is not None
    got = np.hstack([record.sp, record.op, record.pv])
    np.testing.assert_array_equal(got, np.array(rows))


@given(st.text(max_size=200))
def test_any_text_is_a_record_or_one_clear_line(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.csv"
        for content in (text, "t,OP,PV\n" + text, "t,OP,PV\n0,1,2\n" + text):
            path.write_text(content, encoding="utf-8", errors="replace", newline="")
            assert len(outcome(path).splitlines()) == 1


def outcome(path: Path) -> str:
    try:
        return read_csv(path).name
    except InputError as error:
        return str(error)


def test_jitter_is_noted_and_a_gap_is_not_taken(tmp_path: Path) -> None:
    record = read(tmp_path, "t,OP,PV\n0,1,2\n1.03,1,2\n2,1,2\n3,1,2\n")
    assert record.sample_time == 1.0
    assert record.notes == ("sample times jitter by up to 3 %, taken as regular",)
    with pytest.raises(InputError, match="irregular at line 5: 4 s after the sample before, els"):
        read(tmp_path, "t,OP,PV\n0,1,2\n1,1,2\n2,1,2\n6,1,2\n7,1,2\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty; give a CSV file with a header"),
        ("t,OP\n0,1\n1,1\n", "has no column PV; its columns are t, OP; choose with --pv TAG=COL"),
        ("OP,PV\n0,1\n1,1\n", "has no column t; its columns are OP, PV; choose with --time COL"),
        ("t,OP,PV\n0,1,2\n1,bad,2\n", "OP: 1 value of 2 missing (1 'bad'), first: line 3"),
        ("t,OP,PV\n0,1,2\n1,1_0,2\n", "missing (1 '1_0'), first: line 3"),
        ("t,OP,PV\n0,1,2\n1,nan,2\n", "missing (1 'nan'), first: line 3"),
        ("t,OP,PV\n0,1,2\n1,inf,2\n", "missing (1 'inf'), first: line 3"),
        ("t,OP,PV\n0,1,2\n1,,2\n", "OP: 1 value of 2 missing (1 empty), first: line 3"),
        ("t,OP,PV\n0,1,2\n1,1\n", "PV: 1 value of 2 missing (1 empty), first: line 3"),
        ("t,OP,PV\n0,1,2\nnoon,1,2\n", "neither seconds nor a stamp that is known, in line 3"),
        ("t,OP,PV\nnoon,1,2\n1,1,2\n", "neither seconds nor a stamp that is known, in line 2"),
        ("t,OP,PV\n0,1,2\n0,1,2\n", "time does not increase at line 3 (0, then 0 s)"),
        ("t,OP,PV\n5,1,2\n4,1,2\n", "turned, first: line 3"),
        ("t,OP,PV\n0,1,2\n", "has 1 row of data"),
        ("t,OP,PV\n", "has 0 rows of data"),
        ("0,1,2\n1,1,2\n", "has no header"),
        ("t,OP,OP,PV\n0,1,1,2\n1,1,1,2\n", "column OP is there 2 times"),
    ],
)
def test_errors(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    assert message in str(caught.value)
    assert "loop.csv" in str(caught.value)


def test_errors_of_files_and_options(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_csv(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\0\1")
    with pytest.raises(InputError, match="is no text"):
        read_csv(tmp_path / "b.csv")
    with pytest.raises(InputError, match="--sp names Q; it needs one column for each of PV1"):
        read(tmp_path, "t,OP,PV\n0,1,2\n1,1,2\n", sp={"Q": "PV"})


@pytest.mark.trial
@pytest.mark.skipif(not DATA.is_dir(), reason="the measured loops of ../shared/data are missing")
def test_measured_loops() -> None:
    files = [p for folder in ("isdb", "plant") for p in sorted((DATA / folder).glob("*.csv"))]
    records = [open_record(path) for path in files if path.name != "index.csv"]
    assert len(records) == 20
    assert all(len(record) > 700 for record in records)
    assert all(note.startswith("MODE shows 1 alone") for r in records for note in r.notes)
    assert {len(r) for r in records if r.sp is not None} == {751}
    actuator = next((DATA / "damadics").glob("*.csv"))
    columns = {"op": {"V1": "CV_pct"}, "pv": {"F": "F_t_h"}, "stem": {"V1": "X_pct"}}
    record = read_csv(actuator, **columns)  # type: ignore[arg-type]
    assert record.stem is not None
    assert record.stem.shape == (3600, 1)
