"""`stiction convert` and `stiction report`: any record in any form."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sensor_msgs", reason="the definitions of sensor_msgs are not installed")

from as_given import open_record

from stiction_ros.cli.main import main
from stiction_ros.cli.report import holds_live_run

BAGS = Path(__file__).parents[2] / "bags"


@pytest.fixture
def record(tmp_path: Path) -> Path:
    """A record of a loop with its gap from 49 s to 80 s left out."""
    times = np.arange(50.0)
    path = tmp_path / "loop.csv"
    rows = np.column_stack([times, np.sin(times), np.cos(times), np.ones(50)])
    np.savetxt(path, rows, delimiter=",", header="t,OP,PV,SP", comments="", fmt="%.17g")
    return path


@pytest.mark.parametrize("iso", [[], ["--iso"]])
def test_there_and_back_again(record: Path, tmp_path: Path, iso: list[str]) -> None:
    assert main(["convert", str(record), str(tmp_path / "bag")]) == 0
    assert main(["convert", str(tmp_path / "bag"), str(tmp_path / "back.csv"), *iso]) == 0
    was, bag, back = map(open_record, (record, tmp_path / "bag", tmp_path / "back.csv"))
    for key in ("op", "pv", "sp", "time"):
        assert np.array_equal(getattr(was, key), getattr(bag, key))
        assert np.array_equal(getattr(was, key), getattr(back, key))
    assert was.start == back.start


def test_iso_stamps_are_written(record: Path, tmp_path: Path) -> None:
    assert main(["convert", str(record), str(tmp_path / "iso.csv"), "--iso"]) == 0
    lines = (tmp_path / "iso.csv").read_text().splitlines()
    assert lines[2].startswith("1970-01-01T00:00:01Z,")


def test_each_part_of_a_file_with_gaps_becomes_a_record(
    record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with record.open("a") as file:
        file.writelines(f"{80 + k},1,2,3\n" for k in range(20))
    assert main(["convert", str(record), str(tmp_path / "part.csv")]) == 0
    said = capsys.readouterr().err
    assert "part_1.csv: 50 samples of 1 s" in said
    assert "note: split at 1 gap" in said
    assert [len(open_record(tmp_path / f"part_{n}.csv")) for n in (1, 2)] == [50, 20]


def test_the_csv_of_a_bag_of_several_valves_is_read_without_options(tmp_path: Path) -> None:
    target = tmp_path / "tank.csv"
    assert main(["convert", str(BAGS / "sticky_tank"), str(target)]) == 0
    found = open_record(target)
    assert (found.valves, found.outputs) == (("V1", "V2"), ("C", "T"))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["{csv}", "{out}", "--iso"], "--iso: is for CSV files"),
        (["{csv}", "{out}", "--namespace", "one"], "--namespace: is for bags"),
        (["{bag}", "{out}.csv", "--op", "V1=OP"], "is a bag, which has no columns"),
        (["{bag}", "{out}.csv", "--namespace", "one"], "in the namespace one"),
        (["{csv}", "{full}"], "exists and is not empty"),
        (["{out}", "{out}.csv"], "no such file"),
    ],
)
def test_what_cannot_be_done_is_one_clear_line(
    record: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    said: str,
) -> None:
    places = {
        "csv": record,
        "bag": BAGS / "sticky_siso",
        "full": BAGS / "sticky_siso",
        "out": tmp_path / "new",
    }
    assert main(["convert", *(word.format(**places) for word in arguments)]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.strip().splitlines()[-1:]) == 1
    assert "Traceback" not in err


def test_a_bag_of_signals_alone_gets_the_report_of_a_record(record: Path, tmp_path: Path) -> None:
    assert main(["convert", str(record), str(tmp_path / "bag")]) == 0
    assert not holds_live_run(str(tmp_path / "bag"))
    assert holds_live_run(str(BAGS / "sticky_siso"))
