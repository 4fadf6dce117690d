"""Bags that were cut or altered: what is whole comes back, or one clear error does."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from bag_making import JOINT_STATE, SECOND, STORE, Bag, clock, joint_state, read_bag
from bag_trials import trials
from mcap.writer import CompressionType, Writer

from stiction_ros.errors import InputError
from stiction_ros.records.bag.finish import finish_bag
from stiction_ros.records.bag.messages import read_raw
from stiction_ros.records.bag.repair import RepairStatus, repair_bag
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.storage.mcap_scan import MAGIC, McapScan

SAMPLES = 300
PATIENCE = 60.0  # s for one reading, which takes some milliseconds
KINDS = ("zstd", "lz4", "none", "mcap")
Message = tuple[str, int, bytes]


def own_bag(directory: Path, compression: str) -> Path:
    """Return the file of a finished bag in several chunks."""
    bag = Bag(BagWriter(directory, compression, chunk_size=1 << 14))
    bag.text("/plant/config", "seed: 7\nversion: '0.1'", 4 * SECOND)
    bag.put("/clock", "rosgraph_msgs/msg/Clock", clock(5 * SECOND), 5 * SECOND)
    bag.loop(SAMPLES)
    bag.writer.close()
    return directory / f"{directory.name}_0.mcap"


def other_file(path: Path) -> Path:
    """Return a file that the writer of the package ``mcap`` made."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=1 << 14, compression=CompressionType.LZ4)
        writer.start("ros2", "test")
        definition, _ = STORE.generate_msgdef(JOINT_STATE, ros_version=2)
        schema = writer.register_schema(JOINT_STATE, "ros2msg", definition.encode())
        channels = {t: writer.register_channel(t, "cdr", schema, {}) for t in ("/pv", "/op")}
        for k in range(SAMPLES):
            for topic, tag in (("/pv", "P"), ("/op", "V")):
                data = joint_state(k * SECOND, [tag], [float(k)])
                writer.add_message(channels[topic], k * SECOND, data, k * SECOND)
        writer.finish()
    return path


@pytest.fixture(scope="module", params=KINDS)
def whole(request, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp(request.param)
    if request.param == "mcap":
        return other_file(folder / "other.mcap")
    return own_bag(folder / "run", request.param)


def read(path: Path) -> tuple[list[Message], str]:
    """Return the messages before the error, and the error."""
    found: list[Message] = []
    begin = time.monotonic()
    said = ""
    try:
        for message in read_raw(path):
            found.append((message.topic.name, message.log_time, message.data))
    except InputError as error:
        said = str(error)
    assert "\n" not in said
    assert time.monotonic() - begin < PATIENCE
    return found, said


def altered(data: bytes, random: np.random.Generator, count: int) -> Iterator[bytes]:
    """Yield copies of ``data`` with one random byte set to another random value."""
    for _ in range(count):
        copy = bytearray(data)
        copy[int(random.integers(len(copy)))] ^= int(random.integers(1, 256))
        yield bytes(copy)


def test_an_altered_byte_never_gives_a_wrong_value(whole: Path, tmp_path: Path) -> None:
    expected, _ = read(whole)
    path = tmp_path / "altered.mcap"
    errors = 0
    for data in altered(whole.read_bytes(), np.random.default_rng(11), trials(20, 500)):
        path.write_bytes(data)
        found, error = read(path)
        errors += bool(error)
        assert found == (expected[: len(found)] if error else expected)
    assert errors > 0


def test_an_altered_byte_never_gives_a_wrong_record(whole: Path, tmp_path: Path) -> None:
    expected = read_bag(whole)
    path = tmp_path / "altered.mcap"
    for data in altered(whole.read_bytes(), np.random.default_rng(12), trials(8, 500)):
        path.write_bytes(data)
        try:
            record = read_bag(path)
        except InputError:
            continue
        np.testing.assert_array_equal(record.pv, expected.pv)
        np.testing.assert_array_equal(record.op, expected.op)


def test_a_finished_file_that_was_cut_gives_what_is_whole(whole: Path, tmp_path: Path) -> None:
    expected, _ = read(whole)
    data = whole.read_bytes()
    path = tmp_path / "cut.mcap"
    random = np.random.default_rng(13)
    for size in random.integers(0, len(data), trials(15, 200)):
        path.write_bytes(data[: int(size)])
        found, error = read(path)
        assert found == expected[: len(found)]
        assert error == "" or "not an MCAP file" in error


@pytest.fixture(scope="module")
def journal(tmp_path_factory) -> tuple[Path, list[Message]]:
    bag = Bag(BagWriter(tmp_path_factory.mktemp("journal") / "run"))
    bag.loop(SAMPLES)
    return bag.writer.directory / "run_0.mcap", bag.written


def test_a_cut_journal_gives_every_whole_message(
    journal: tuple[Path, list[Message]], tmp_path: Path
) -> None:
    source, written = journal
    data = source.read_bytes()
    path = tmp_path / "cut.mcap"
    random = np.random.default_rng(14)
    for size in random.integers(0, len(data), trials(15, 200)):
        path.write_bytes(data[: int(size)])
        found, error = read(path)
        assert found == written[: len(found)]
        assert error == "" or "not an MCAP file" in error
        if found and len(found) < len(written):  # the next message was cut
            rest = int(size) - sum(len(item[2]) + 31 for item in found)
            assert rest < len(data) - sum(len(item[2]) + 31 for item in written) + 31 + 400


@pytest.mark.parametrize("kind", ["cut", "altered"])
def test_a_repaired_file_is_whole_and_holds_nothing_else(
    kind: str, whole: Path, tmp_path: Path
) -> None:
    expected = set(read(whole)[0])
    data = whole.read_bytes()
    random = np.random.default_rng(15)
    path = tmp_path / "ill.mcap"
    for _ in range(trials(6, 100)):
        if kind == "cut":
            path.write_bytes(data[: int(random.integers(100, len(data)))])
        else:
            path.write_bytes(next(altered(data, random, 1)))
        if not path.read_bytes().startswith(MAGIC):
            continue
        done = repair_bag(path)
        found, error_text = read(path)
        assert error_text == ""
        assert len(found) == sum(done.messages.values())
        assert set(found) <= expected
        assert repair_bag(path).status is RepairStatus.WHOLE


def test_salvage_keeps_the_chunks_behind_a_damaged_one(tmp_path: Path) -> None:
    path = own_bag(tmp_path / "run", "zstd")
    expected, _ = read(path)
    data = bytearray(path.read_bytes())
    data[200] ^= 0xFF  # in the first chunk, which announces every topic
    path.write_bytes(data)
    done = repair_bag(path.parent)
    found, error = read(path.parent)
    assert (done.status, error) == (RepairStatus.SALVAGED, "")
    assert 0 < len(found) < len(expected)
    assert found == expected[-len(found) :]
    assert path.with_suffix(".mcap.damaged").read_bytes() == bytes(data)


def test_a_damaged_summary_is_a_note_when_the_data_are_whole(tmp_path: Path) -> None:
    path = own_bag(tmp_path / "run", "zstd")
    expected, _ = read(path)
    data = bytearray(path.read_bytes())
    data[-60] ^= 0xFF
    path.write_bytes(data)
    notes: list[str] = []
    assert [m.data for m in read_raw(path, notes)] == [item[2] for item in expected]
    assert notes == [
        "the summary of run_0.mcap is damaged (the checksum of the summary is wrong), not its data"
    ]
    assert repair_bag(path).status is RepairStatus.FINISHED
    assert repair_bag(path).status is RepairStatus.WHOLE


def test_blocks_that_a_file_system_left_empty_are_left_out(tmp_path: Path) -> None:
    bag = Bag(BagWriter(tmp_path / "run"))
    bag.loop(5)
    path = bag.writer.directory / "run_0.mcap"
    path.write_bytes(path.read_bytes() + bytes(4096))
    scan = McapScan(path)
    assert len(list(scan.messages())) == len(bag.written)
    assert "its last 4096 bytes" in scan.notes[0]
    finish_bag(bag.writer.directory)
    assert len(read(path)[0]) == len(bag.written)
