"""The bag of a live run with a pause, a bad message or a restart: its report, and its replay."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bag_cutting import SECOND, copy_bag, cut_bag
from bag_making import joint_state

from stiction_ros.cli.main import main
from stiction_ros.records.bag.messages import read_raw
from stiction_ros.records.bag.playback import offered_qos
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.record import Quality
from stiction_ros.records.run.log import RunLog, read_run
from stiction_ros.records.storage.mcap_scan import RawMessage

LIVE = Path(__file__).parents[2] / "bags" / "sticky_siso"


@pytest.fixture(scope="module")
def whole() -> RunLog:
    return read_run(LIVE)


def paused(target: Path, first: float, last: float, bag: Path = LIVE) -> Path:
    """A bag without what came from ``first`` to ``last`` s."""

    def outside(raw: RawMessage) -> RawMessage | None:
        return None if first * SECOND <= raw.log_time < last * SECOND else raw

    return copy_bag(bag, target, outside)


def restarted(target: Path, bag: Path = LIVE) -> Path:
    """The beginning of a bag, and then all of it, as when a plant is started again."""
    messages = list(read_raw(bag))
    with BagWriter(target) as writer:
        for raw in [*(m for m in messages if m.log_time < 150 * SECOND), *messages]:
            topic = raw.topic
            if topic.name not in writer.counts:
                kind = (topic.name, topic.type, topic.definition, topic.type_hash)
                writer.add_topic(*kind, offered_qos(topic))
            writer.write(topic.name, raw.data, raw.log_time, raw.publish_time)
    return target


@pytest.mark.trial
def test_a_pause_leaves_every_sample_at_its_place(tmp_path: Path, whole: RunLog) -> None:
    run = read_run(paused(tmp_path / "bag", 400.0, 460.0))
    assert (run.swap_sample, len(run.record)) == (whole.swap_sample, len(whole.record))
    missing = run.record.quality == Quality.BAD
    there = set(np.flatnonzero(~missing).tolist())  # the first is at 1 s
    assert not there & set(range(400, 458))
    assert there >= {*range(398), *range(461, len(whole.record))}
    np.testing.assert_array_equal(run.record.pv[~missing], whole.record.pv[~missing])
    assert run.stem_estimate is not None
    assert whole.stem_estimate is not None
    known = ~np.isnan(run.stem_estimate[:, 0])
    assert 58 <= np.count_nonzero(~known) <= 63
    np.testing.assert_array_equal(run.stem_estimate[known], whole.stem_estimate[known])
    count = np.count_nonzero(missing)
    assert run.notes[-1] == f"{count} of {len(whole.record)} samples are missing"
    assert "split at 1 gap" in run.notes


@pytest.mark.parametrize(
    ("first", "last", "status", "told"),
    [
        (400.0, 460.0, "ok", " samples are missing"),
        pytest.param(700.0, 760.0, "ok", " samples are missing", marks=pytest.mark.trial),
        pytest.param(
            *(150.0, 550.0, "no_round", "gap in the last round of set-points before the swap"),
            marks=pytest.mark.trial,
        ),
        pytest.param(
            *(1450.0, 2050.0, "no_round", "gap in the first round of set-points after the swap"),
            marks=pytest.mark.trial,
        ),
        pytest.param(1080.0, 1110.0, "no_swap", " samples are missing", marks=pytest.mark.trial),
    ],
)
def test_the_report_of_a_run_with_a_pause(
    tmp_path: Path, first: float, last: float, status: str, told: str
) -> None:
    bag = paused(tmp_path / "bag", first, last)
    assert main(["report", str(bag), "--out", str(tmp_path / "out")]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    page = (tmp_path / "out" / "report.html").read_text()
    assert told in page
    if status != "no_swap":  # what the controller said of its swap may be in the pause
        assert summary["status"] == status
    if status == "ok":
        scores = summary["phases"]
        ratio = scores["after"]["PV1"]["amplitude"] / scores["before"]["PV1"]["amplitude"]
        assert ratio < 0.1


@pytest.mark.trial
def test_the_report_of_a_restarted_plant_is_that_of_the_longest_run(
    tmp_path: Path, whole: RunLog
) -> None:
    bag = restarted(tmp_path / "bag")
    run = read_run(bag)
    np.testing.assert_array_equal(run.record.pv, whole.record.pv)
    assert (run.swap, run.modes, run.fits) == (whole.swap, whole.modes, whole.fits)
    assert [config.topic for config in run.configs] == [c.topic for c in whole.configs]
    assert "2 runs are told apart: stamps fall back" in run.notes
    last = re.fullmatch(r"another run, 1 s to (\d+) s, \1 samples, is left out", run.notes[-1])
    assert last is not None
    assert 145 < int(last[1]) < 150
    assert main(["report", str(bag), "--out", str(tmp_path / "r.html")]) == 0
    assert f"another run, 1 s to {last[1]} s" in (tmp_path / "r.html").read_text()


def test_a_bad_message_of_a_live_run(tmp_path: Path, whole: RunLog) -> None:
    def spoil(raw: RawMessage) -> RawMessage:
        if raw.topic.name != "/pv" or raw.log_time != 300 * SECOND:
            return raw
        return raw._replace(data=joint_state(300 * SECOND, ["PV1"], []))

    run = read_run(copy_bag(LIVE, tmp_path / "bag", spoil))
    assert run.swap_sample == whole.swap_sample
    assert np.flatnonzero(run.record.quality).tolist() == [299]
    np.testing.assert_array_equal(run.record.op, whole.record.op)


@pytest.mark.trial
@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (restarted, "holds 2 runs, a replay needs one run from its first sample"),
        (
            lambda target, bag: paused(target, 400.0, 460.0, bag),
            "samples are missing within the bag",
        ),
    ],
)
def test_a_replay_says_what_stands_in_its_way(
    fault: Callable[[Path, Path], Path],
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    begun = cut_bag(LIVE, tmp_path / "begun", last=1200.0)  # two fits, and the swap
    assert main(["replay", str(fault(tmp_path / "bag", begun))]) == 1
    assert words in " ".join(capsys.readouterr().out.split())
