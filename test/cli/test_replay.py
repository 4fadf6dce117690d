"""`stiction replay` on a sample bag: what it prints, its JSON, its exit codes."""

import contextlib
import io
import json
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "records"))
from as_given import open_record
from bag_cutting import cut_bag

from stiction_ros.cli.main import main
from stiction_ros.records.run.log import read_run

BAGS = Path(__file__).parents[2] / "bags"


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The last part of a run: quick to replay, as it holds one whole window."""
    path = tmp_path_factory.mktemp("late") / "bag"
    return cut_bag(BAGS / "sticky_siso", path, first=1020.0)


@pytest.fixture(scope="module")
def replayed(late: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, dict[str, Any]]:
    """What the command prints of that part, and its JSON."""
    target, said = tmp_path_factory.mktemp("json") / "replay.json", io.StringIO()
    with contextlib.redirect_stdout(said):
        code = main(["replay", str(late), "--json", str(target)])
    # The bits of a fit are those of the processor that recorded the bag: 1 is right as well.
    assert code in (0, 1)
    return said.getvalue(), json.loads(target.read_text(encoding="utf-8"))


def test_it_prints_fits_swap_and_what_is_not_known(replayed: tuple[str, dict[str, Any]]) -> None:
    said = " ".join(replayed[0].split())
    assert "2079 s" in said
    assert "op and modes are not" in said


def test_the_json_holds_the_friction_that_was_found_live(
    late: Path, replayed: tuple[str, dict[str, Any]]
) -> None:
    document = replayed[1]
    assert document["bag"] == str(late)
    assert document["from_first_sample"] is False
    fit = document["fits"][-1]
    assert (fit["time"], fit["whole_window"]) == (2079.0, True)
    live = read_run(BAGS / "sticky_siso").fits[-1].identification["valves"][0]
    assert fit["valves"][0]["f_s"] == pytest.approx(live["f_s"], rel=1e-6)
    assert fit["valves"][0]["f_d"] == pytest.approx(live["f_d"], rel=1e-6)


@pytest.mark.parametrize(
    ("bag", "said"),
    [("signals_only", "holds no configuration of an estimator"), ("none", "no such bag")],
)
def test_what_cannot_be_replayed_is_one_clear_line(
    bag: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(BAGS / bag)]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("name", "samples", "step", "swap"),
    [("sticky_siso", 2100, 1.0, 1094.0), ("sticky_tank", 1860, 60.0, 44880.0)],
)
def test_the_sample_bags_hold_what_their_readme_says(
    name: str, samples: int, step: float, swap: float
) -> None:
    log = read_run(BAGS / name)
    assert (len(log.record), log.record.sample_time) == (samples, step)
    assert log.swap is not None
    assert log.seconds(log.swap.stamp) == swap
    assert f"swapped at {swap:.0f} s" in (BAGS / "README.md").read_text()


def test_sample_bags_are_small() -> None:
    for bag in (path for path in BAGS.iterdir() if path.is_dir()):
        assert sum(path.stat().st_size for path in bag.iterdir()) < 1_000_000


def test_the_bag_of_signals_holds_the_record_alone() -> None:
    record = open_record(BAGS / "signals_only")
    assert (len(record), record.sample_time, record.notes) == (2500, 1.0, ())
    assert record.stem is not None
