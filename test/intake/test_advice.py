"""What an error advises works when it is followed."""

import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from exports import HEADER, ROWS, iso, op, pv, table, text, write

from stiction_ros.cli.main import main

SHARE = text([[t, str(float(u) / 100.0), *rest] for t, u, *rest in table()])
VOLTS = text([[t, str(float(u) / 10.0), y] for t, u, y, _ in table()], ["t", "OP [V]", "PV"])
PLAIN = [row[1:] for row in table()]


def tall(names: tuple[str, str], header: list[str], more: bool = False) -> str:
    rows = [
        [name, iso(k), str(value(k)), *([str(3 + (k * 7) % 5)] if more else [])]
        for k in range(ROWS)
        for name, value in zip(names, (op, pv), strict=True)
    ]
    return text(rows, header)


def modes(words: tuple[str, str]) -> str:
    rows = [
        [t, "33.0" if k < 50 else u, *rest, words[k >= 50]]
        for k, (t, u, *rest) in enumerate(table())
    ]
    return text(rows, [*HEADER, "MODE"])


STRANGE = text(table(), ["Wann", "Klappe", "Menge", "Soll"])
TWICE = text([[t, u, u, y] for t, u, y, _ in table()], ["t", "OP", "PV", "Flow"])
SWAPPED = text([[t, y, u, s] for t, u, y, s in table()], ["t", "OP [%]", "PV", "SP"])
EMPTY = text([[t, u, "", y] for t, u, y, _ in table()], ["t", "OP", "PV", "Flow"])
TOO_HIGH = text([[t, str(9 * float(u)), y] for t, u, y, _ in table()], ["t", "OP [%]", "PV"])
REPEATED = text([table()[0], *table()])

OPTIONS = [
    ("names", STRANGE, "choose with --op TAG=COLUMN --pv TAG=COLUMN", "--op V=Klappe --pv P=Menge"),
    ("no time", text(PLAIN, HEADER[1:]), "with --sample-time S say that", "--sample-time 10"),
    ("time", text([[*row[:2], str(k)] for k, row in enumerate(PLAIN)], ["OP", "PV", "X"]),
     "choose with --time COLUMN", "--time X"),
    ("share", SHARE, "--op-unit share or --op-unit percent", "--op-unit share"),
    ("percent", SHARE, "--op-unit share or --op-unit percent", "--op-unit percent"),
    ("volts", VOLTS, "--op-unit 0-10v, --op-unit 1-5v", "--op-unit 0-10v"),
    ("volts as they are", VOLTS, "with --op-unit other", "--op-unit other"),
    ("unit", TOO_HIGH, "--op-unit other takes OP as it is", "--op-unit other"),
    ("twice", TWICE, "--op V1=COLUMN --pv PV1=COLUMN", "--op V1=OP --pv PV1=Flow"),
    ("no number", EMPTY, "--op TAG=COLUMN --pv TAG=COLUMN", "--op V=OP --pv P=Flow"),
    ("mode", modes(("X1", "X2")), "such as --auto X2", "--auto X2"),
    ("moving mode", modes(("Zwang", "Regelung")), "such as --auto Regelung", "--auto Regelung"),
    ("known manual", modes(("MAN", "P7")), "such as --auto P7", "--auto P7"),
    ("value", tall(("F.OP", "F.PV"), [*"abcd"], more=True), "--long a,b,c", "--long a,b,c"),
    ("milliseconds", text([[str(1000 * k), *r] for k, r in enumerate(PLAIN)], ["t", *HEADER[1:]]),
     "--time-unit ms or --time-unit s", "--time-unit ms"),
    ("dates", text([[f"01/02/2024 12:{k // 6:02d}:{k % 6}0", *r] for k, r in enumerate(PLAIN)]),
     "--dates dmy or --dates mdy", "--dates mdy"),
]  # fmt: skip


def refused(path: Path, capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(["convert", str(path), str(path.with_name("out.csv")), *words]) == 2
    return capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "advice", "words"),
    [case[1:] for case in OPTIONS],
    ids=[case[0] for case in OPTIONS],
)
def test_an_option_that_is_advised_helps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str, advice: str, words: str
) -> None:
    path = write(tmp_path / "a.csv", content)
    assert advice in refused(path, capsys)
    assert main(["convert", str(path), str(tmp_path / "out.csv"), *shlex.split(words)]) == 0


ROWS_OF_TAGS = [
    ("names", STRANGE, "file,loop,pv,op\na.csv,F,Menge,Klappe\n"),
    ("share", SHARE, "file,op_unit\na.csv,share\n"),
    ("volts", VOLTS, "file,op_unit\na.csv,0-10v\n"),
    ("no time", text(PLAIN, HEADER[1:]), "file,sample_time\na.csv,10\n"),
    ("texts", tall(("FY1", "FT1"), ["a", "b", "c"]), "loop,pv,op\nF1,FT1,FY1\n"),
]


@pytest.mark.parametrize(
    ("content", "rows"), [case[1:] for case in ROWS_OF_TAGS], ids=[case[0] for case in ROWS_OF_TAGS]
)
def test_a_list_of_tags_that_is_advised_helps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str, rows: str
) -> None:
    path = write(tmp_path / "a.csv", content)
    assert "--tags" in refused(path, capsys)
    tags = write(tmp_path / "tags.csv", rows)
    assert main(["convert", str(path), str(tmp_path / "out.csv"), "--tags", str(tags)]) == 0


def headed(mark: str) -> tuple[str, str, str]:
    rows = text([[str(k), *row] for k, row in enumerate(PLAIN)], [], mark).lstrip("\n")
    names = mark.join(("t", "OP", "PV", "SP"))
    return rows, f"such as {names!r}", f"{names}\n{rows}"


MENDED: list[tuple[str, str, str]] = [
    *(headed(mark) for mark in (",", ";", "\t", " ")),
    (text(table(), ["t", "OP"]), "name every column", text(table())),
    (
        text(table(), ["t", "OP", "PV", "PV"]),
        "column PV is there 2 times; rename one of them",
        text(table(), ["t", "OP", "PV", "PV2"]),
    ),
    (text(table()[:1]), "a record needs two at least", text(table())),
    ("", "is empty; give a CSV file with a header", text(table())),
    ("<html><table></table>", "save it as .xlsx or CSV", text(table())),
]


@pytest.mark.parametrize(("content", "advice", "mended"), MENDED)
def test_a_file_that_is_changed_as_advised_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str, advice: str, mended: str
) -> None:
    path = write(tmp_path / "a.csv", content)
    assert advice in refused(path, capsys)
    assert main(["convert", str(write(path, mended)), str(tmp_path / "out.csv")]) == 0


@pytest.mark.parametrize("words", [(), ("--sample-time", "10")])
def test_two_columns_of_numbers_and_no_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    """As data sets of identification are kept: each sentence is followed, one after the other."""
    rows = "".join(f"   {op(k):e}   {pv(k):e}\n" for k in range(ROWS))
    path = write(tmp_path / "a.dat", rows)
    assert "such as 'OP PV'" in refused(path, capsys)
    write(path, "OP PV\n" + rows)
    if not words:
        assert "--sample-time S" in refused(path, capsys)
    else:
        assert main(["convert", str(path), str(tmp_path / "out.csv"), *words]) == 0


MENDS: list[tuple[str, Callable[[list[list[str]]], object]]] = [
    ("(1 'Bad')", lambda rows: rows[7].__setitem__(1, "50.0")),
    ("time does not increase", lambda rows: rows.sort()),
]


@pytest.mark.parametrize(("said", "mend"), MENDS)
def test_what_strict_refuses_is_read_when_it_is_mended(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    said: str,
    mend: Callable[[list[list[str]]], object],
) -> None:
    rows = table()
    if "Bad" in said:
        rows[7][1] = "Bad"
    else:
        rows[40], rows[41] = rows[41], rows[40]
    path = write(tmp_path / "a.csv", text(rows))
    assert said in refused(path, capsys, "--strict")
    mend(rows)
    write(path, text(rows))
    assert main(["convert", str(path), str(tmp_path / "out.csv"), "--strict"]) == 0


def test_strict_refuses_what_times_of_each_tag_leave_open(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [[iso(k), str(pv(k)), iso(k + 9), str(op(k + 9))] for k in range(ROWS)]
    path = write(tmp_path / "a.csv", text(rows, ["Time", "F.PV", "Time", "F.OP"]))
    assert "18 samples without every value" in refused(path, capsys, "--strict")


def test_swapped_signals(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "a.csv", SWAPPED)
    found = refused(path, capsys)
    for advice in found.partition("name them, ")[2].split(" (or")[0].split(", or as they are, "):
        words = shlex.split(advice)
        assert main(["convert", str(path), str(tmp_path / "out.csv"), *words]) == 0


def test_one_column_for_op_and_pv(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "a.csv", text(table()))
    found = refused(path, capsys, "--op", "V1=OP", "--pv", "PV1=OP")
    assert "one signal is given twice: OP is OP at all of 120 samples; name each with" in found
    assert "given twice" in refused(path, capsys, "--op", "V1=OP", "--op", "V2=OP")
    out = str(tmp_path / "out.csv")
    assert main(["convert", str(path), out, "--op", "V1=OP", "--pv", "PV1=PV"]) == 0
