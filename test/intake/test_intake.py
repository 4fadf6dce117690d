import gzip
import tempfile
from pathlib import Path

from hypothesis import example, given
from hypothesis import strategies as st

from stiction_ros.intake import IntakeOptions, loops
from stiction_ros.intake.intake_options import OpUnit, TimeUnit


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
