"""The law of the bag reader: what it calls good was sent, for that sample, by that run."""

import shutil
import types
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from as_given import open_record
from bag_making import SECOND, STORE, Bag, joint_state, read_bag
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer

from stiction_ros.errors import InputError
from stiction_ros.intake.intake import CsvColumns
from stiction_ros.records.bag.messages import BagMessage, read_messages, read_raw
from stiction_ros.records.record import Quality
from stiction_ros.records.run.loop_runs import BagLoops, LoopRun, read_bag_parts
from stiction_ros.records.run.loop_signals import JOINT_STATE, LoopSignals

STEP = 10**8  # ns between two samples
RUN = 100_000.0  # what a value of the next run is larger by


class Message(NamedTuple):
    """One message: its topic, sample and value, or a fault."""

    topic: str
    sample: int
    value: float
    fault: str = ""


def of(message: Message) -> BagMessage:
    names, values = ["X"], [message.value]
    if message.fault == "empty":
        names, values = [], []
    elif message.fault == "nan":
        values = [float("nan")]
    elif message.fault == "short":
        values = []
    stamp = message.sample * STEP
    time = types.SimpleNamespace(sec=stamp // 10**9, nanosec=stamp % 10**9)
    state = types.SimpleNamespace(
        header=types.SimpleNamespace(stamp=time), name=names, position=values
    )
    return BagMessage(f"/{message.topic}", JOINT_STATE, 0, 0, state)


def sent(number: int, first: int, count: int) -> Iterator[Message]:
    """Give what a run sends: PV of a sample is its number, OP a half more, SP a quarter."""
    for k in range(first, first + count):
        value = RUN * number + k
        yield Message("sp", k, value + 0.25)
        yield Message("pv", k, value)
        yield Message("op", k, value + 0.5)


def read(messages: list[Message]) -> tuple[LoopRun, ...]:
    signals = LoopSignals("bag")
    for number, message in enumerate(messages):
        signals.add(of(message), number)
    return BagLoops(signals, [], {}, 0.0, []).runs(None)


@st.composite
def logs(draw: st.DrawFn) -> list[Message]:
    """Draw what is left of up to three runs of a plant."""
    log: list[Message] = []
    begun = draw(st.integers(0, 500))
    for number in range(draw(st.integers(1, 3))):
        first = max(begun - draw(st.integers(0, 300)), 0) if number else begun
        begun = first
        run = list(sent(number, first, draw(st.integers(60, 120))))
        if draw(st.booleans()):  # a pause
            begin = draw(st.integers(90, len(run) - 1))  # its beginning tells that it is new
            left = run[:begin] + run[begin + draw(st.integers(1, 200)) :]
            run = left if len(left) >= 120 else run
        for _ in range(draw(st.integers(0, 4))):
            if not run:
                break
            place = draw(st.integers(0, len(run) - 1))
            what = draw(st.sampled_from(["empty", "nan", "short", "lost", "again", "late"]))
            if what == "lost":
                run.pop(place)
            elif what == "again":
                run.insert(place, run[place])
            elif what == "late":
                run.insert(min(place + draw(st.integers(1, 6)), len(run) - 1), run.pop(place))
            else:
                run[place] = run[place]._replace(fault=what)
        if log and draw(st.booleans()):  # the last messages of the run before come late
            late = [log.pop() for _ in range(draw(st.integers(0, 6))) if len(log) > 1][::-1]
            for message in late:
                run.insert(draw(st.integers(0, min(12, len(run)))), message)
        log += run
    return log


@given(logs())
def test_what_is_good_was_sent_for_that_sample_by_that_run(log: list[Message]) -> None:
    try:
        runs = read(log)
    except InputError:
        return
    for run in runs:
        for part in run.parts:
            sample = np.rint((part.start + part.time) / (STEP / 1e9))
            good = part.quality == Quality.GOOD
            of_run = np.round((part.pv[:, 0] - sample) / RUN)
            assert len(set(of_run[good])) == 1
            np.testing.assert_array_equal((part.pv[:, 0] - RUN * of_run)[good], sample[good])
            np.testing.assert_array_equal((part.op - part.pv)[good], 0.5)
            assert np.isfinite(part.pv).all()
            assert part.sample_time == pytest.approx(STEP / 1e9)


@given(st.integers(1, 3), st.integers(0, 500), st.integers(30, 150))
def test_of_whole_runs_nothing_is_lost(count: int, first: int, samples: int) -> None:
    log = [m for number in range(count) for m in sent(number, max(first - number, 0), samples)]
    runs = read(log)
    assert [len(run) for run in runs] == [samples] * count
    for number, run in enumerate(runs):
        (part,) = run.parts
        assert part.mask is None
        assert part.pv[0, 0] == RUN * number + max(first - number, 0)
        assert part.sp is not None
        np.testing.assert_array_equal(part.sp - part.pv, 0.25)


def closed(bag: Bag) -> Path:
    bag.writer.close()
    return bag.writer.directory


def test_record_of_a_loop(bag: Bag) -> None:
    bag.loop(20)
    record = read_bag(closed(bag))
    assert (record.sample_time, record.start, len(record)) == (1.0, 5.0, 20)
    assert (record.valves, record.outputs) == (("V1", "V2"), ("C", "T"))
    np.testing.assert_array_equal(record.pv[:, 0], 7.0 + np.arange(20))
    np.testing.assert_array_equal(record.op[:, 0], 50.0 + np.arange(20))
    assert record.sp is not None
    assert record.stem is not None
    assert record.notes == ()


def test_directory_file_and_unfinished_file_are_the_same_record(bag: Bag, tmp_path: Path) -> None:
    bag.loop(20, "/unit1")
    shutil.copy(bag.writer.directory / "run_0.mcap", tmp_path / "torn.mcap")
    path = closed(bag)
    records = [open_record(p) for p in (path, path / "run_0.mcap", tmp_path / "torn.mcap")]
    for record in records:
        np.testing.assert_array_equal(record.pv, records[0].pv)
    assert [len(record.notes) for record in records] == [0, 0, 1]


def test_bags_of_another_writer(tmp_path: Path) -> None:
    with Writer(tmp_path / "other", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, tag in (("/pv", "P"), ("/op", "V")):
            connection = writer.add_connection(topic, JOINT_STATE, typestore=STORE)
            for k in range(10):
                data = joint_state(k * SECOND // 2, [tag], [float(k)])
                writer.write(connection, k, data)
    record = open_record(tmp_path / "other")
    assert (record.sample_time, len(record), record.sp) == (0.5, 10, None)


def test_set_points_are_held_and_lone_samples_left_out(bag: Bag) -> None:
    for k in range(10):
        bag.joint("/pv", k * SECOND, {"A": float(k), "B": 0.0})
        if k < 9:
            bag.joint("/op", k * SECOND, {"V": 1.0})
    bag.joint("/sp", 2 * SECOND, {"B": 0.0, "A": 5.0})
    bag.joint("/sp", 6 * SECOND + 1, {"A": 8.0, "B": 0.0})
    bag.joint("/stem", 0, {"V": 1.0})
    record = read_bag(closed(bag))
    assert record.sp is not None
    assert record.stem is None
    assert record.sp[:, 0].tolist() == [5.0] * 7 + [8.0] * 2
    assert record.notes == (
        "1 messages of pv or op without the other of their stamp left out",
        "no sp for the first 2 samples, the first one given is taken",
        "stem is missing at 8 of 9 samples, all of it is left out",
    )


def test_two_loops_need_a_namespace(bag: Bag) -> None:
    bag.loop(5, "/a")
    bag.loop(6, "/b")
    path = closed(bag)
    with pytest.raises(InputError, match="holds 2 loops \\(/a, /b\\); choose one"):
        read_bag(path)
    assert len(read_bag(path, namespace="b")) == 6
    with pytest.raises(InputError, match="in the namespace c"):
        read_bag(path, namespace="c")


def test_a_bag_of_a_loop_that_was_only_listened_to(bag: Bag) -> None:
    for k in range(10):
        bag.joint("/FIC101/pv", k * SECOND, {"A": float(k)})
        bag.joint("/FIC101/op_applied", k * SECOND, {"V": 50.0 + k})
    bag.joint("/other/pv", 0, {"A": 0.0})
    path = closed(bag)
    for namespace in (None, "/FIC101"):
        record = read_bag(path, namespace=namespace)
        assert record.valves == ("V",)
        np.testing.assert_array_equal(record.op[:, 0], 50.0 + np.arange(10))
        assert record.notes == ("no topic op, op_applied is taken as OP",)
    with pytest.raises(InputError, match="no loop in the namespace /other; its loops are /FIC101"):
        read_bag(path, namespace="/other")


@pytest.mark.parametrize(
    ("topics", "said"),
    [
        (("/pv",), "holds no pv with op .* record pv and op of a loop, not only /pv"),
        (("/op_applied",), "not only /op_applied"),
        (("/a/pv", "/b/op"), "in one namespace; .* not only /a/pv, /b/op"),
    ],
)
def test_what_a_bag_without_a_loop_lacks(bag: Bag, topics: tuple[str, ...], said: str) -> None:
    for topic in topics:
        bag.joint(topic, 0, {"A": 0.0})
    path = closed(bag)
    for namespace in (None, "/FIC101"):
        with pytest.raises(InputError, match=said):
            read_bag(path, namespace=namespace)


def test_a_gap_is_told(bag: Bag) -> None:
    for k in (0, 1, 2, 5, 6):
        bag.joint("/pv", k * SECOND, {"A": 1.0})
        bag.joint("/op", k * SECOND, {"V": 1.0})
    path = closed(bag)
    assert [len(part) for part in read_bag_parts(path)] == [3, 2]


def test_errors(bag: Bag, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such bag"):
        list(read_raw(tmp_path / "nowhere"))
    (tmp_path / "void").mkdir()
    with pytest.raises(InputError, match=r"holds no \.mcap file"):
        read_bag(tmp_path / "void")
    (tmp_path / "x.mcap").write_bytes(b"t,OP,PV\n")
    with pytest.raises(InputError, match="not an MCAP file"):
        open_record(tmp_path / "x.mcap")
    bag.text("/mode", "hold", 1)
    path = closed(bag)
    with pytest.raises(InputError, match=r"holds no pv with op .* record pv and op of a loop$"):
        read_bag(path)
    with pytest.raises(InputError, match="has no columns"):
        open_record(path, CsvColumns(time="t"))
    (path / "run_0.mcap").unlink()
    with pytest.raises(InputError, match=r"run_0\.mcap is missing"):
        read_bag(path)


def test_undecodable_topics_are_noted(bag: Bag) -> None:
    bag.writer.add_topic("/odd", "odd_msgs/msg/Odd", "no definition !\n", "")
    bag.writer.write("/odd", b"\0\1\0\0", 1, 1)
    bag.loop(3)
    notes: list[str] = []
    assert len(list(read_messages(closed(bag), notes=notes))) == 12
    assert notes == ["topic /odd (odd_msgs/msg/Odd) cannot be decoded, left out"]


def test_signals_that_cannot_be_decoded_are_the_reason_given(tmp_path: Path) -> None:
    path = tmp_path / "idl.mcap"
    with path.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros2", "test")
        schema = writer.register_schema(JOINT_STATE, "ros2idl", b"module m {};")
        for topic in ("/pv", "/op"):
            channel = writer.register_channel(topic, "cdr", schema, {})
            writer.add_message(channel, 0, joint_state(0, ["A"], [1.0]), 0)
        writer.finish()
    with pytest.raises(InputError, match=r"no pv with op .*/pv .* cannot be decoded"):
        read_bag(path)


def test_a_message_that_does_not_fit_is_an_error(bag: Bag) -> None:
    data = joint_state(0, ["A"], [1.0])
    bag.put("/pv", JOINT_STATE, data[:30], 0)
    with pytest.raises(InputError, match="does not fit its definition"):
        list(read_messages(closed(bag)))


def test_flipped_bytes_never_give_wrong_values(bag: Bag) -> None:
    bag.loop(30)
    path = closed(bag) / "run_0.mcap"
    whole = bytearray(path.read_bytes())
    random = np.random.default_rng(1)
    errors = 0
    for _ in range(300):
        damaged = bytearray(whole)
        damaged[int(random.integers(len(whole)))] ^= 1 << int(random.integers(8))
        path.write_bytes(damaged)
        read = []
        try:
            for message in read_raw(path):
                read.append((message.topic.name, message.log_time, message.data))
        except InputError:
            errors += 1
            assert read == bag.written[: len(read)]
        else:
            assert read == bag.written
    assert errors > 150


def test_every_cut_of_a_finished_file_gives_a_prefix_or_an_error(bag: Bag) -> None:
    bag.loop(30)
    path = closed(bag) / "run_0.mcap"
    whole = path.read_bytes()
    for size in range(0, len(whole), 13):
        path.write_bytes(whole[:size])
        try:
            read = [(m.topic.name, m.log_time, m.data) for m in read_raw(path)]
        except InputError:
            continue
        assert read == bag.written[: len(read)]


def test_one_missing_stem_is_held_and_told(bag: Bag) -> None:
    for k in range(5):
        for topic, tag in (("/pv", "PV1"), ("/op", "V1"), ("/stem", "V1")):
            if (topic, k) != ("/stem", 4):
                bag.joint(topic, k * SECOND, {tag: float(k)})
    bag.writer.close()
    record = read_bag(bag.writer.directory)
    assert record.stem is not None
    assert record.stem[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 3.0]
    assert record.notes == ("stem is missing at 1 of 5 samples, the one before is held there",)
