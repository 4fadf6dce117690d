"""Bags as other recorders leave them: out of order, packed, without definitions, of sqlite3."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
import zstandard
from bag_making import JOINT_STATE, SECOND, STORE, Bag, joint_state
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import read_raw
from stiction_ros.records.bag.repair import repair_bag
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.run.loop_runs import read_bag_parts

DEFINITION, _ = STORE.generate_msgdef(JOINT_STATE, ros_version=2)
SAMPLES = 200
STEP = 5


def loop_file(
    path: Path, stamps: Sequence[int], definition: str = DEFINITION, *, chunk: int = 4096
) -> Path:
    """Write a loop whose messages stand in the order of ``stamps``, s; 0 makes no chunks."""
    with path.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=chunk or 1, use_chunking=bool(chunk))
        writer.start("ros2", "test")
        schema = writer.register_schema(JOINT_STATE, "ros2msg", definition.encode())
        channels = {
            (name, tag): writer.register_channel(name, "cdr", schema, {})
            for name, tag in (("/pv", "PV1"), ("/op", "V1"))
        }
        for stamp in stamps:
            time = stamp * SECOND
            for (_, tag), channel in channels.items():
                writer.add_message(
                    channel, time, joint_state(time, [tag], [50.0 + stamp % 7]), time
                )
        writer.finish()
    return path


def swapped(count: int = SAMPLES) -> list[int]:
    return [STEP * (k ^ 1) for k in range(count)]


@pytest.mark.parametrize("chunk", [0, 500, 4096, 1 << 20])
def test_neighbours_that_are_swapped_are_one_run(tmp_path: Path, chunk: int) -> None:
    (part,) = read_bag_parts(loop_file(tmp_path / "x.mcap", swapped(), chunk=chunk))
    assert (len(part), part.sample_time, part.notes) == (SAMPLES, STEP, ())


@given(
    times=st.lists(st.integers(0, 30), max_size=60),
    size=st.integers(40, 400),
    chunked=st.booleans(),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_messages_come_by_log_time_and_then_as_in_the_file(
    tmp_path: Path, times: list[int], size: int, chunked: bool
) -> None:
    path = tmp_path / "x.mcap"
    with path.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=size, use_chunking=chunked)
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
        channel = writer.register_channel("/e", "cdr", schema)
        for number, time in enumerate(times):
            writer.add_message(channel, time, number.to_bytes(2, "big"), time)
        writer.finish()
    read = [(m.log_time, int.from_bytes(m.data, "big")) for m in read_raw(path)]
    assert read == sorted((time, number) for number, time in enumerate(times))


def test_blocks_in_another_order_are_one_run(tmp_path: Path) -> None:
    blocks = [range(60, 90), range(30), range(90, SAMPLES), range(30, 60)]
    stamps = [STEP * k for block in blocks for k in block]
    (part,) = read_bag_parts(loop_file(tmp_path / "x.mcap", stamps))
    assert (len(part), part.notes) == (SAMPLES, ())


@pytest.mark.parametrize("chunk", [0, 500, 1 << 20])
def test_runs_of_a_plant_that_was_restarted_are_not_mixed(tmp_path: Path, chunk: int) -> None:
    path = loop_file(tmp_path / "x.mcap", [*range(70), *range(SAMPLES)], chunk=chunk)
    assert [len(part) for part in read_bag_parts(path)] == [70, SAMPLES]


def test_a_journal_keeps_its_order_as_its_first_times_may_be_of_the_wall(tmp_path: Path) -> None:
    bag = Bag(BagWriter(tmp_path / "run"))
    bag.text("/config", "a: 1", 10**18)
    bag.joint("/pv", SECOND, {"PV1": 1.0})
    assert [m.topic.name for m in read_raw(tmp_path / "run")] == ["/config", "/pv"]


@pytest.mark.parametrize("definition", ["", "  \n", "# nothing\n"])
def test_a_missing_definition_is_one_clear_error(tmp_path: Path, definition: str) -> None:
    path = loop_file(tmp_path / "x.mcap", swapped(), definition)
    with pytest.raises(InputError, match=r"/pv .* has no definition .*record it again"):
        read_bag_parts(path)


def test_the_definition_of_another_type_is_one_clear_error(tmp_path: Path) -> None:
    path = loop_file(tmp_path / "x.mcap", swapped(), "uint32 level\n")
    with pytest.raises(InputError, match="/pv is not that of sensor_msgs/msg/JointState"):
        read_bag_parts(path)


def packed(data: bytes, frames: int = 1) -> bytes:
    size = -(-len(data) // frames)
    pieces = [data[k : k + size] for k in range(0, len(data), size)]
    return b"".join(zstandard.ZstdCompressor().compress(piece) for piece in pieces)


@pytest.mark.parametrize(("end", "frames"), [("zstd", 1), ("zst", 3)])
def test_a_file_packed_whole_is_read(tmp_path: Path, end: str, frames: int) -> None:
    plain = loop_file(tmp_path / "x.mcap", swapped())
    file = tmp_path / f"x.mcap.{end}"
    file.write_bytes(packed(plain.read_bytes(), frames))
    assert list(read_raw(file)) == list(read_raw(plain))


def test_a_packed_file_that_is_cut_off_is_an_error(tmp_path: Path) -> None:
    file = tmp_path / "x.mcap.zstd"
    file.write_bytes(packed(loop_file(tmp_path / "x.mcap", swapped()).read_bytes())[:-20])
    with pytest.raises(InputError, match="cut off or damaged; pack or copy it anew"):
        list(read_raw(file))


def test_repair_asks_for_a_packed_file_to_be_unpacked(tmp_path: Path) -> None:
    file = tmp_path / "x.mcap.zstd"
    file.write_bytes(packed(loop_file(tmp_path / "x.mcap", swapped()).read_bytes()))
    with pytest.raises(InputError, match=r"unpack it with `zstd -d .*x\.mcap\.zstd`"):
        repair_bag(file)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    with BagWriter(tmp_path / "bag") as writer:
        Bag(writer).loop(12)
    return tmp_path / "bag"


def listing(folder: Path, before: str, after: str) -> None:
    file = folder / "metadata.yaml"
    text = file.read_text()
    assert before in text
    file.write_text(text.replace(before, after))


@pytest.mark.parametrize("unpacked", [False, True])
def test_a_bag_of_compression_mode_file_is_read(folder: Path, unpacked: bool) -> None:
    before = list(read_raw(folder))
    (plain,) = folder.glob("*.mcap")
    listing(folder, plain.name, f"{plain.name}.zstd")
    listing(folder, "compression_mode: ''", "compression_mode: FILE")
    if not unpacked:
        plain.with_name(f"{plain.name}.zstd").write_bytes(packed(plain.read_bytes()))
        plain.unlink()
    notes: list[str] = []
    assert list(read_raw(folder, notes)) == before
    assert notes == []


def test_a_blank_storage_id_is_that_of_the_files(folder: Path) -> None:
    before = list(read_raw(folder))
    listing(folder, "storage_identifier: mcap", "storage_identifier: ''")
    assert list(read_raw(folder)) == before


def sqlite_bag(path: Path) -> Path:
    with RosbagsWriter(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        for name, tag in (("/pv", "PV1"), ("/op", "V1")):
            connection = writer.add_connection(name, JOINT_STATE, typestore=STORE)
            for k in range(20):
                time = k * SECOND
                writer.write(connection, time, joint_state(time, [tag], [50.0 + k]))
    return path


def commands(error: str) -> Iterator[list[str]]:
    for command in re.findall("`(.*?)`", error):
        yield shlex.split(command)


@pytest.mark.parametrize("bare", [False, True])
def test_the_advice_on_a_bag_of_sqlite3_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bare: bool
) -> None:
    bag = sqlite_bag(tmp_path / "old plant")
    given = next(bag.glob("*.db3")) if bare else bag
    with pytest.raises(InputError, match="sqlite3") as error:
        read_bag_parts(given)
    (install, convert) = commands(str(error.value))
    assert install == ["pip", "install", "rosbags"]
    monkeypatch.chdir(tmp_path)
    subprocess.run([str(Path(sys.executable).with_name(convert[0])), *convert[1:]], check=True)
    target = convert[convert.index("--dst") + 1]
    assert [len(part) for part in read_bag_parts(target)] == [20]
