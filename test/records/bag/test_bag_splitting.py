"""Bags in several files: written, killed, finished, read here and by others."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from as_given import run_metadata
from bag_making import SECOND, Bag, clock, read_bag
from rosbags.rosbag2 import Reader

from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import read_raw
from stiction_ros.records.bag.repair import RepairStatus, repair_bag
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.storage.log_time import SIMULATED

CONFIG = "node: /plant\nversion: '0.1'\nseed: 7\n"


def split_bag(directory: Path, **most: int) -> Bag:
    bag = Bag(BagWriter(directory, **most))
    bag.text("/plant/config", CONFIG, 5 * SECOND)
    bag.loop(100)
    bag.text("/loop_model", "loop: tank", 110 * SECOND)
    return bag


@pytest.fixture(params=[{"most_bytes": 8000}, {"most_ns": 10 * SECOND}], ids=["size", "s"])
def split(request, tmp_path: Path) -> Bag:
    return split_bag(tmp_path / "run", **request.param)


def raw(path: Path) -> list[tuple[str, int, bytes]]:
    return [(m.topic.name, m.log_time, m.data) for m in read_raw(path)]


def names(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


def test_all_files_are_read_in_their_order(split: Bag) -> None:
    journals = raw(split.writer.directory)
    split.writer.close()
    assert len(names(split.writer.directory)) > 5
    assert journals == raw(split.writer.directory) == split.written
    assert read_bag(split.writer.directory).notes == ()


def test_ten_files_and_more_stay_in_their_order(tmp_path: Path) -> None:
    bag = split_bag(tmp_path / "run", most_ns=SECOND)
    bag.writer.close()
    assert "run_100.mcap" in names(tmp_path / "run")
    assert raw(tmp_path / "run") == bag.written


def test_rosbags_reads_every_message_of_every_file(split: Bag) -> None:
    split.writer.close()
    with Reader(split.writer.directory) as reader:
        assert reader.message_count == len(split.written)
        found = [(c.topic, time, bytes(data)) for c, time, data in reader.messages()]
    assert sorted(found) == sorted(split.written)


def test_a_file_holds_no_more_than_its_duration(tmp_path: Path) -> None:
    split_bag(tmp_path / "run", most_ns=10 * SECOND).writer.close()
    for path in (tmp_path / "run").glob("*.mcap"):
        times = [message.log_time for message in read_raw(path)]
        assert max(times) - min(times) < 10 * SECOND


def test_a_file_holds_little_more_than_its_size(tmp_path: Path) -> None:
    bag = split_bag(tmp_path / "run", most_bytes=20000)
    for path in sorted((tmp_path / "run").glob("*.mcap"))[:-1]:
        assert 20000 <= path.stat().st_size < 20000 + 200
    bag.writer.close()


def test_metadata_lists_every_file_with_its_share(split: Bag) -> None:
    split.writer.close()
    directory = split.writer.directory
    text = (directory / "metadata.yaml").read_text()
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert information["message_count"] == len(split.written)
    assert information["duration"]["nanoseconds"] == 105 * SECOND
    assert sum(file["message_count"] for file in information["files"]) == len(split.written)
    for file in information["files"]:
        assert file["message_count"] == len(raw(directory / file["path"]))
    assert information["custom_data"]["seed"] == "7"


def test_every_file_tells_of_the_run(split: Bag) -> None:
    directory = split.writer.directory
    for finished in (False, True):
        if finished:
            split.writer.close()
        found = run_metadata(directory)
        assert found["config:/plant"] == CONFIG
        assert found["loop_model:/loop_model"] == "loop: tank"
        assert (found["seed"], found["version"]) == ("7", "0.1")
        for path in directory.glob("*.mcap"):
            assert run_metadata(path)["config:/plant"] == CONFIG


def test_a_killed_writer_of_many_files_is_repaired(split: Bag, tmp_path: Path) -> None:
    killed = tmp_path / "killed" / "run"
    shutil.copytree(split.writer.directory, killed)
    split.writer.close()
    shutil.copy(split.writer.directory / "run_0.mcap", killed)  # the kill came while finishing
    (killed / "run_1.mcap.part").write_bytes(b"half")
    assert raw(killed) == split.written
    done = repair_bag(killed)
    assert done.status is RepairStatus.FINISHED
    assert names(killed) == names(split.writer.directory)
    assert raw(killed) == split.written
    assert run_metadata(killed) == run_metadata(split.writer.directory)
    with Reader(killed) as reader:
        assert sum(1 for _ in reader.messages()) == len(split.written)


def test_messages_before_the_clock_get_its_time_across_files(tmp_path: Path) -> None:
    wall = 1_790_000_000 * SECOND
    bag = Bag(BagWriter(tmp_path / "run", most_bytes=2500))
    for number in range(40):
        bag.text("/mode", "unaware", wall + number)
    bag.writer.add_metadata(SIMULATED, {"first": str(5 * SECOND)})
    for second in range(5, 30):
        kind = "rosgraph_msgs/msg/Clock"
        bag.put("/clock", kind, clock(second * SECOND), second * SECOND)
    files = len(names(tmp_path / "run"))
    bag.writer.close()
    assert files > 2
    times = [time for _, time, _ in raw(tmp_path / "run")]
    assert times == [5 * SECOND] * 41 + [second * SECOND for second in range(6, 30)]


def test_a_missing_file_is_told(split: Bag) -> None:
    directory = split.writer.directory
    (directory / "run_2.mcap").unlink()
    notes: list[str] = []
    assert list(read_raw(directory, notes))
    assert "the file with number 2 is missing" in notes
    split.writer.close()
    (directory / "run_1.mcap").unlink()
    with pytest.raises(InputError, match=r"run_1\.mcap is missing; put it back"):
        list(read_raw(directory))


def test_what_metadata_says_is_compared_with_the_files(split: Bag) -> None:
    split.writer.close()
    directory = split.writer.directory
    text = (directory / "metadata.yaml").read_text()
    listing = yaml.safe_load(text)
    for entry in listing["rosbag2_bagfile_information"]["topics_with_message_count"]:
        if entry["topic_metadata"]["name"] == "/pv":
            entry["message_count"] = 99
    (directory / "metadata.yaml").write_text(yaml.safe_dump(listing))
    shutil.copy(directory / "run_0.mcap", directory / "stray_7.mcap")
    notes = read_bag(directory).notes
    assert notes == (
        "stray_7.mcap is not in metadata.yaml, left out",
        "the files hold other messages than metadata.yaml says: 100 of 99 on /pv",
    )


def test_the_time_of_a_file_counts_from_simulated_time(tmp_path: Path) -> None:
    bag = Bag(BagWriter(tmp_path / "run", most_ns=100 * SECOND))
    bag.text("/plant/config", CONFIG, 1_790_000_000 * SECOND)
    bag.loop(50)
    bag.writer.close()
    assert names(tmp_path / "run") == ["metadata.yaml", "run_0.mcap"]
    np.testing.assert_array_equal(read_bag(tmp_path / "run").pv[:, 0], 7.0 + np.arange(50))


def test_a_next_file_that_finds_no_room_leaves_the_present_one_in_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = split_bag(tmp_path / "run", most_bytes=8000)
    files = names(tmp_path / "run")
    monkeypatch.setattr("stiction_ros.records.bag.writer.Journal.put", refused)
    refusals = 0
    for k in range(200, 300):
        try:
            bag.loop(1, start=k * SECOND)
        except OSError:
            refusals += 1
    assert refusals
    assert names(tmp_path / "run") == files
    monkeypatch.undo()
    bag.loop(100, start=400 * SECOND)
    bag.writer.close()
    assert raw(tmp_path / "run") == bag.written
    found: list[str] = []
    list(read_raw(tmp_path / "run", found))
    assert found == []


def refused(*_args: object) -> None:
    raise OSError(28, "No space left on device")


def test_only_what_came_before_simulated_time_gets_the_first_one(tmp_path: Path) -> None:
    """Also when a later file begins with other messages than the first on ``/clock``."""
    bag = Bag(BagWriter(tmp_path / "run", most_ns=3 * SECOND))
    wall = 1_700_000_000 * SECOND
    for _ in range(3):
        bag.text("/plant/config", CONFIG, wall)
    bag.writer.add_metadata(SIMULATED, {"first": str(5 * SECOND)})
    for k in range(20):
        stamp = (5 + k) * SECOND
        if k % 4 == 0:
            bag.put("/clock", "rosgraph_msgs/msg/Clock", clock(stamp), stamp)
        bag.joint("/pv", stamp, {"A": float(k)})
        bag.joint("/op", stamp, {"V": float(k)})
    bag.writer.close()
    assert len(names(tmp_path / "run")) > 4
    times = [log_time for _, log_time, _ in raw(tmp_path / "run")]
    assert times == sorted(times)
    assert times[:4] == [5 * SECOND] * 4


def test_a_recorder_may_tell_the_first_simulated_time(tmp_path: Path) -> None:
    bag = Bag(BagWriter(tmp_path / "run"))
    wall = 1_700_000_000 * SECOND
    bag.put("/clock", "rosgraph_msgs/msg/Clock", clock(99 * SECOND), wall)  # of another loop
    bag.writer.add_metadata(SIMULATED, {"first": str(5 * SECOND)})
    bag.loop(10)
    bag.writer.close()
    times = [log_time for _, log_time, _ in raw(tmp_path / "run")]
    assert times == sorted(times)
    assert (times[0], times[-1]) == (5 * SECOND, 14 * SECOND)


def test_what_was_removed_is_written_again(tmp_path: Path) -> None:
    bag = split_bag(tmp_path / "run", most_bytes=8000)
    assert bag.writer.put_back() == ""
    count = len(names(tmp_path / "run"))
    kept = len(raw(tmp_path / "run" / f"run_{count - 1}.mcap"))
    shutil.rmtree(tmp_path / "run")
    said = bag.writer.put_back()
    assert f"run_{count - 1}.mcap was removed and is written again; {count - 1} files" in said
    assert bag.writer.put_back() == ""
    bag.text("/mode", "hold", 200 * SECOND)
    bag.writer.close()
    assert raw(tmp_path / "run") == bag.written[-kept - 1 :]


def test_what_is_removed_just_before_the_end_is_finished_all_the_same(tmp_path: Path) -> None:
    bag = Bag(BagWriter(tmp_path / "run"))
    bag.loop(10)
    shutil.rmtree(tmp_path / "run")
    bag.writer.close()
    assert raw(tmp_path / "run") == bag.written
