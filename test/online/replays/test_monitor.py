"""A replay gives again what the monitor told, and says so when it does not."""

import dataclasses
import json
import sys
from pathlib import Path

import pytest
import yaml

sys.path.insert(0, str(Path(__file__).parents[2] / "records"))
sys.path.insert(0, str(Path(__file__).parents[1]))
from bag_cutting import SECOND, Change, copy_bag, cut_bag
from bag_making import Bag
from monitored_loops import RULE, WATCHED, loop, record, shifted

from stiction_ros import __version__
from stiction_ros.online.loop_estimator import EstimatorNodeSettings
from stiction_ros.online.monitor.gap_monitor import GapMonitor
from stiction_ros.online.replays.result import Comparison, Match
from stiction_ros.online.replays.run import replay
from stiction_ros.records.bag.messages import read_messages
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.run.events import gap_log
from stiction_ros.records.storage.mcap_scan import RawMessage
from stiction_ros.texts import json_text

SAMPLES = 1120
SETTINGS = EstimatorNodeSettings(
    **dataclasses.asdict(RULE), loop="watched", fit_first=100_000, fit_every=100_000
)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A loop whose sensor shifts, with what the monitor told of it."""
    path = tmp_path_factory.mktemp("monitored") / "bag"
    made = Bag(BagWriter(path))
    values = dataclasses.asdict(SETTINGS) | {"wait_for": []}
    document = {"node": "/estimator", "version": __version__, "parameters": values}
    document["model"] = loop().to_mapping()
    made.text("/estimator/config", yaml.safe_dump(document, sort_keys=False), SECOND)
    recorded = record(shifted(), SAMPLES)
    monitor = GapMonitor(SETTINGS, *WATCHED, loop())
    for k in range(SAMPLES):
        stamp = (k + 1) * SECOND
        made.joint("/pv", stamp, {"PV1": recorded.pv[k, 0]})
        made.joint("/op", stamp, {"V1": recorded.op[k, 0]})
        if k % 200 == 20:
            made.diagnostics(stamp, "estimator: status", {"sample": str(k + 1)})
        look = monitor.add(k, recorded.op[k], recorded.pv[k])
        if look is not None:
            _tell(made, stamp, "gap", "look", json_text(look.to_dict(), indent=None))
        for found in monitor.collect():
            _tell(made, stamp, "finding", "finding", json_text(found.to_dict(), indent=None))
    made.writer.close()
    return path


def _tell(made: Bag, stamp: int, task: str, key: str, document: str) -> None:
    made.diagnostics(stamp, f"estimator: {task}", {"window_end": str(stamp), key: document})


def spoilt(old: str, new: str) -> Change:
    """Return a change of the first measurement, which ends at 549 s; ``new`` is as long."""
    assert len(old) == len(new)

    def work(raw: RawMessage) -> RawMessage:
        if raw.topic.name != "/diagnostics" or raw.log_time != 550 * SECOND:
            return raw
        assert old.encode() in raw.data
        return raw._replace(data=raw.data.replace(old.encode(), new.encode()))

    return work


@pytest.mark.trial
def test_everything_that_the_monitor_told_comes_again(bag: Path) -> None:
    found = replay(bag)
    assert found.monitor == (Comparison(12, 12), Comparison(1, 1))
    assert found.match is Match.EQUAL


def test_a_bag_that_begins_late_has_no_baseline(bag: Path, tmp_path: Path) -> None:
    found = replay(cut_bag(bag, tmp_path / "bag", first=100.0))
    assert found.monitor is not None
    for one in found.monitor:
        assert one == Comparison(difference="the bag begins after the baseline")


@pytest.mark.trial
def test_another_figure_is_named(bag: Path, tmp_path: Path) -> None:
    found = replay(copy_bag(bag, tmp_path / "bag", spoilt('"begin": 250', '"begin": 251')))
    assert found.monitor is not None
    assert (found.monitor[0].compared, found.monitor[0].equal) == (12, 11)
    assert found.first_difference == (
        "gap of the window that ends at 549 s: look.begin: recorded 251, replayed 250"
    )


@pytest.mark.trial
def test_what_does_not_come_again_is_named(bag: Path, tmp_path: Path) -> None:
    old, new = str(550 * SECOND), str(551 * SECOND)
    found = replay(copy_bag(bag, tmp_path / "bag", spoilt(old, new)))
    assert found.first_difference == "gap of the window that ends at 550 s: recorded, not replayed"


@pytest.mark.trial
def test_the_json_tells_what_was_compared(bag: Path) -> None:
    document = json.loads(json_text(replay(bag).to_dict()))
    assert document["monitor"]["looks"] == 12
    assert document["monitor"]["match"] == "equal"


def test_what_is_no_document_is_left_out(tmp_path: Path) -> None:
    made = Bag(BagWriter(tmp_path / "bag"))
    for value in ("{", "[1]", ""):
        made.diagnostics(5, "estimator: gap", {"window_end": "5", "look": value})
    made.diagnostics(5, "estimator: gap", {"window_end": "soon", "look": "{}"})
    made.diagnostics(7, "estimator: gap", {"window_end": "7", "look": '{"grown": false}'})
    made.writer.close()
    assert dict(gap_log(read_messages(tmp_path / "bag")).looks) == {7: {"grown": False}}
