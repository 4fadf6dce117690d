"""Columns of qualities are known by what they mean."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from exports import HEADER, ROWS, iso, one, op, pv, said, table, text, write

from stiction_ros.intake import Loop
from stiction_ros.records.record import Quality

BAD = range(30, 33)


def masked(loop: Loop) -> list[int]:
    assert loop.problem is None
    (record,) = loop.parts
    return [k for k in range(len(record)) if record.quality[k] != Quality.GOOD]


MEANINGS = [
    ("Confidence", "100", "0"),
    ("confidence", "1", "0.2"),
    ("Validity", "1", "0"),
    ("QualityDetail", "192", "24"),
    ("Quality", "100", "0"),
    ("OPC Quality", "216", "64"),
    ("StatusCode", "0", "2147483648"),
    ("Good", "True", "False"),
    ("IsGood", "1", "0"),
    ("is_valid", "yes", "no"),
    ("Questionable", "False", "True"),
    ("IsBad", "0", "1"),
    ("Point_Quality", "GOOD, clamped", "UNCERTAIN, last known"),
    ("whatever", "Good", "I/O Timeout"),
]


@pytest.mark.parametrize(("name", "good", "bad"), MEANINGS)
@pytest.mark.parametrize("shape", ["wide", "long"])
def test_what_is_bad_is_masked_and_counted(
    tmp_path: Path, name: str, good: str, bad: str, shape: str
) -> None:
    words = [bad if k in BAD else good for k in range(ROWS)]
    rows = [[*row, word] for row, word in zip(table(), words, strict=True)]
    header = [*HEADER, name]
    if shape == "long":
        header = ["Tag", "Time", "Value", name]
        rows = [
            [f"F.{signal}", iso(k), str(value(k)), words[k]]
            for k in range(ROWS)
            for signal, value in (("PV", pv), ("OP", op))
        ]
    out = "\n".join(";".join(row) for row in [header, *rows])
    loop = one(write(tmp_path / "a.csv", out))
    assert masked(loop) == list(BAD)
    assert "PV: 3 values of 120 missing (3 'of bad quality')" in said(loop)


@pytest.mark.parametrize(("good", "bad"), [("0", "1"), ("Fine", "Odd")])
def test_what_is_not_known_is_told(tmp_path: Path, good: str, bad: str) -> None:
    rows = [[*row, bad if k in BAD else good] for k, row in enumerate(table())]
    path = write(tmp_path / "a.csv", text(rows, [*HEADER, "Quality"]))
    loop = one(path)
    assert masked(loop) == []
    assert f"Quality shows 117 '{good.casefold()}', 3 '{bad.casefold()}', of which it is not" in (
        said(loop)
    )


def test_numbers_are_known_in_a_column_that_is_renamed(tmp_path: Path) -> None:
    rows = [[*row, "1" if k in BAD else "0"] for k, row in enumerate(table())]
    for name, expected in (("Bad", list(BAD)), ("Good", [k for k in range(ROWS) if k not in BAD])):
        loop = one(write(tmp_path / "a.csv", text(rows, [*HEADER, name])))
        assert masked(loop) == expected if name == "Bad" else loop.problem is None


def test_several_columns_of_whole_rows_count_together(tmp_path: Path) -> None:
    rows = [[*row, str(k != 31), str(k == 40), "false"] for k, row in enumerate(table())]
    header = [*HEADER, "IsGood", "Questionable", "Substituted"]
    assert masked(one(write(tmp_path / "a.csv", text(rows, header)))) == [31, 40]


@pytest.mark.parametrize(
    ("op_name", "pv_name", "op_quality", "pv_quality"),
    [
        ("OP", "PV", "Quality", "Quality"),
        ("OP", "PV", "Quality1", "Quality2"),
        ("OP", "PV", "OP_Quality", "PV_Quality"),
        ("F.OP", "F.PV", "F.OP.IsGood", "F.PV.IsGood"),
    ],
)
def test_a_quality_is_of_its_signal(
    tmp_path: Path, op_name: str, pv_name: str, op_quality: str, pv_quality: str
) -> None:
    good, bad = ("1", "0") if "IsGood" in op_quality else ("Good", "Bad")
    rows = [
        [t, u, bad if k == 31 else good, y, bad if k == 40 else good]
        for k, (t, u, y, _) in enumerate(table())
    ]
    loop = one(
        write(tmp_path / "a.csv", text(rows, ["t", op_name, op_quality, pv_name, pv_quality]))
    )
    assert masked(loop) == [31, 40]
    assert f"{op_name}: 1 value of 120 missing" in said(loop)
    assert f"{pv_name}: 1 value of 120 missing" in said(loop)


def test_the_quality_of_another_tag_says_nothing(tmp_path: Path) -> None:
    rows = [[*row[:3], "7", "Bad" if k in BAD else "Good"] for k, row in enumerate(table())]
    header = ["t", "F.OP", "F.PV", "TI9", "TI9.Quality"]
    assert masked(one(write(tmp_path / "a.csv", text(rows, header)))) == []


def test_a_measured_quality_is_no_quality(tmp_path: Path) -> None:
    rows = [[*row, f"{97.0 + 0.013 * k:.3f}"] for k, row in enumerate(table())]
    loop = one(write(tmp_path / "a.csv", text(rows, [*HEADER, "Product quality"])))
    assert loop.notes == ()
