from pathlib import Path

import pytest

from stiction_ros.cli.main import main
from stiction_ros.records.bag.messages import read_raw
from stiction_ros.records.storage.bag_metadata import BagTopic
from stiction_ros.records.storage.mcap_scan import RawMessage
from stiction_studies.benches.speed import record as bench_record

TOPIC = BagTopic("/mode", "std_msgs/msg/String", "string data\n")


@pytest.mark.parametrize("compression", ["zstd", "none"])
def test_both_writers_write_the_same_messages(
    compression: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench_record, "REPEATS", 1)
    messages = [RawMessage(TOPIC, k, k + 1, k.to_bytes(4, "little") * 30) for k in range(500)]
    row = bench_record._writers(compression, messages, tmp_path)
    assert row.ratio > 0
    assert "messages of 120 bytes a second" in row.note
    written = [(m.log_time, m.publish_time, m.data) for m in messages] * bench_record.ROUNDS
    for name in (f"{compression}0", f"{compression}0.mcap"):
        read = [(m.log_time, m.publish_time, m.data) for m in read_raw(tmp_path / name)]
        assert read == written


@pytest.mark.trial
def test_the_nodes_are_compared_on_messages_of_which_none_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")
    monkeypatch.setattr(bench_record, "COUNT", 100)
    row = bench_record._nodes(tmp_path)
    assert row.subject_ms > 0
    assert "lost 0 and 0 of 300" in row.note


def test_options_of_other_benchmarks_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "record", "--seed", "1"]) == 2
    assert "benchmark record has no such option" in capsys.readouterr().err
