import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from bag_making import JOINT_STATE, LATCHED, SECOND, Bag, clock, joint_state
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from stiction_ros.errors import InputError
from stiction_ros.records.bag.finish import finish_bag
from stiction_ros.records.bag.messages import read_messages, read_raw
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.storage.bag_metadata import Qos
from stiction_ros.records.storage.log_time import SIMULATED


def filled(bag: Bag) -> Path:
    """Return a finished bag with five topics, one of them latched, and one without messages."""
    bag.writer.add_metadata("run", {"seed": "7", "version": "0.1"})
    bag.loop(200)
    bag.text("/mode", "unaware", 5 * SECOND)
    bag.writer.add_topic("/empty", "std_msgs/msg/String", "string data\n", "", Qos())
    bag.writer.close()
    return bag.writer.directory


def test_rosbags_reads_the_same_messages(bag: Bag) -> None:
    path = filled(bag)
    with Reader(path) as reader:
        read = [(c.topic, time, bytes(data)) for c, time, data in reader.messages()]
        assert reader.message_count == len(bag.written)
        hashes = {connection.topic: connection.digest for connection in reader.connections}
    assert sorted(read) == sorted(bag.written)
    assert hashes["/pv"].startswith("RIHS01_a13ee3a3")


def test_rosbags_and_mcap_decode_the_same_values(bag: Bag) -> None:
    path = filled(bag)
    ours: dict[str, list[Any]] = {}
    for message in read_messages(path, wanted=lambda topic: topic.type == JOINT_STATE):
        ours.setdefault(message.topic, []).append(message.message)
    theirs: dict[str, list[Any]] = {}
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            if connection.msgtype == JOINT_STATE:
                decoded = reader.deserialize(data, connection.msgtype)
                theirs.setdefault(connection.topic, []).append(decoded)
    with (path / "run_0.mcap").open("rb") as stream:
        library = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        third = [
            m.ros_msg if hasattr(m, "ros_msg") else m[3]
            for m in library.iter_decoded_messages(topics=["/pv"])
        ]
    assert ours.keys() == theirs.keys()
    for topic in ours:
        assert len(ours[topic]) == len(theirs[topic]) == 200
        for a, b in zip(ours[topic], theirs[topic], strict=True):
            assert list(a.name) == list(b.name)
            np.testing.assert_array_equal(a.position, b.position)
            assert a.header.stamp.sec == b.header.stamp.sec
    assert [m.position for m in third] == [m.position for m in ours["/pv"]]


def test_mcap_checks_every_checksum_and_finds_the_metadata(bag: Bag) -> None:
    path = filled(bag)
    with (path / "run_0.mcap").open("rb") as stream:
        for _ in StreamReader(stream, validate_crcs=True).records:
            pass
    with (path / "run_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(bag.written)
    assert summary.chunk_indexes
    assert {c.compression for c in summary.chunk_indexes} == {"zstd"}
    assert metadata["run"] == {"seed": "7", "version": "0.1"}
    inside = yaml.safe_load(metadata["rosbag2"]["serialized_metadata"])
    outside = yaml.safe_load((path / "metadata.yaml").read_text())
    assert inside == outside["rosbag2_bagfile_information"]


def test_metadata_counts_and_qos_agree_with_the_channels(bag: Bag) -> None:
    path = filled(bag)
    information = yaml.safe_load((path / "metadata.yaml").read_text())[
        "rosbag2_bagfile_information"
    ]
    assert information["version"] == 9
    assert information["message_count"] == len(bag.written)
    assert information["duration"]["nanoseconds"] == 199 * SECOND
    assert information["starting_time"]["nanoseconds_since_epoch"] == 5 * SECOND
    with (path / "run_0.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    channels = {c.topic: c.metadata["offered_qos_profiles"] for c in summary.channels.values()}
    for entry in information["topics_with_message_count"]:
        topic = entry["topic_metadata"]
        assert topic["offered_qos_profiles"] == yaml.safe_load(channels[topic["name"]])
        assert entry["message_count"] == bag.writer.counts[topic["name"]]
    assert yaml.safe_load(channels["/mode"])[0]["durability"] == "transient_local"
    assert yaml.safe_load(channels["/pv"])[0]["deadline"] == {"sec": 9223372036, "nsec": 854775807}


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["/a", "/b", "/unit/c"]), st.integers(0, 2**62), st.binary(max_size=300)
        ),
        max_size=60,
    ),
    st.sampled_from(["zstd", "lz4", "none"]),
    st.sampled_from([64, 4096]),
)
def test_any_bytes_come_back(
    messages: list[tuple[str, int, bytes]], compression: str, chunk_size: int
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bag"
        with BagWriter(path, compression, chunk_size=chunk_size) as writer:
            for topic in ("/a", "/b", "/unit/c"):
                writer.add_topic(topic, "std_msgs/msg/String", "string data\n", "", LATCHED)
            for topic, time, data in messages:
                writer.write(topic, data, time, time + 1)
            journal = [(m.topic.name, m.log_time, m.data) for m in read_raw(path)]
        finished = [(m.topic.name, m.log_time, m.data) for m in read_raw(path)]
        with Reader(path) as reader:
            assert reader.message_count == len(messages)
            assert sum(1 for _ in reader.messages()) == len(messages)
    assert journal == messages
    assert finished == sorted(messages, key=lambda message: message[1])


def test_a_killed_writer_loses_nothing_and_is_repaired(bag: Bag, tmp_path: Path) -> None:
    bag.loop(50)
    killed = tmp_path / "killed" / "run"
    shutil.copytree(bag.writer.directory, killed)
    notes: list[str] = []
    read = [(m.topic.name, m.log_time, m.data) for m in read_raw(killed, notes)]
    assert read == bag.written
    assert notes == ["run_0.mcap was not closed by its writer"]
    finish_bag(killed)
    with Reader(killed) as reader:
        assert sum(1 for _ in reader.messages()) == len(bag.written)


KILLED = """
import sys
from stiction_ros.records.bag.writer import BagWriter
writer = BagWriter(sys.argv[1])
writer.add_topic("/mode", "std_msgs/msg/String", "string data\\n", "")
k = 0
while True:
    writer.write("/mode", k.to_bytes(8, "little"), k, k)
    sys.stdout.write(f"{k}\\n")
    sys.stdout.flush()
    k += 1
"""


def test_after_sigkill_everything_that_write_returned_for_is_there(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    command = [sys.executable, "-c", KILLED, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        while process.stdout.readline() != "2000\n":
            pass
        process.kill()
        last = int(["2000", *process.stdout.read().split()][-1])
    numbers = [int.from_bytes(message.data, "little") for message in read_raw(path)]
    assert numbers == list(range(len(numbers)))
    assert len(numbers) > last
    finish_bag(path)
    with Reader(path) as reader:
        assert sum(1 for _ in reader.messages()) == len(numbers)


def test_every_cut_of_a_journal_gives_a_prefix(bag: Bag, tmp_path: Path) -> None:
    bag.loop(5)
    whole = (bag.writer.directory / "run_0.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    lengths = set()
    for size in range(8, len(whole), 7):
        cut.write_bytes(whole[:size])
        read = [(m.topic.name, m.log_time, m.data) for m in read_raw(cut)]
        assert read == bag.written[: len(read)]
        lengths.add(len(read))
    assert lengths == set(range(len(bag.written)))


def test_refuses_what_is_there(bag: Bag, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="exists and is not empty; choose another place"):
        BagWriter(bag.writer.directory)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file"):
        BagWriter(tmp_path / "file")
    (tmp_path / "empty").mkdir()
    BagWriter(tmp_path / "empty").close()


def test_refuses_an_unknown_packing_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="compression"):
        BagWriter(tmp_path / "run", "gzip")
    assert not (tmp_path / "run").exists()


def test_an_empty_bag_opens(tmp_path: Path) -> None:
    BagWriter(tmp_path / "nothing").close()
    assert list(read_raw(tmp_path / "nothing")) == []
    with Reader(tmp_path / "nothing") as reader:
        assert list(reader.messages()) == []


def test_errors_of_use(bag: Bag) -> None:
    with pytest.raises(InputError, match="/pv was not added"):
        bag.writer.write("/pv", b"", 0, 0)
    bag.joint("/pv", 0, {"PV1": 1.0})
    with pytest.raises(InputError, match="cannot also be"):
        bag.writer.add_topic("/pv", "std_msgs/msg/String", "string data\n", "")
    bag.writer.close()
    bag.writer.close()
    with pytest.raises(InputError, match="closed"):
        bag.writer.add_metadata("late", {})


def test_two_profiles_of_one_topic(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        profiles = [Qos(), Qos(reliability="best_effort", history="unknown", depth=0)]
        writer.add_topic("/pv", JOINT_STATE, "", "", profiles)
        writer.write("/pv", joint_state(0, ["A"], [1.0]), 1, 1)
    with Reader(tmp_path / "bag") as reader:
        assert sum(1 for _ in reader.messages()) == 1


def test_what_came_before_the_clock_gets_its_first_time(bag: Bag) -> None:
    wall = 1_790_000_000 * SECOND
    bag.text("/plant/config", "seed: 1", wall)
    bag.writer.add_metadata(SIMULATED, {"first": str(5 * SECOND)})
    bag.put("/clock", "rosgraph_msgs/msg/Clock", clock(5 * SECOND), 5 * SECOND)
    bag.text("/mode", "unaware", 6 * SECOND)
    bag.writer.close()
    times = {m.topic: m.log_time for m in read_messages(bag.writer.directory)}
    assert times == {"/plant/config": 5 * SECOND, "/clock": 5 * SECOND, "/mode": 6 * SECOND}
