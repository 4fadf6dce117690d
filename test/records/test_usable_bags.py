"""What happens to a bag in a plant, and what identify, report and convert still make of it."""

import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from bag_making import JOINT_STATE, SECOND, Bag, joint_state, read_bag

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_ros.records.record import Quality
from stiction_ros.records.run.log import read_run
from stiction_ros.records.run.loop_runs import read_bag_parts

sys.path.insert(0, str(Path(__file__).parents[1] / "identification"))
from simulated_loops import example1

SAMPLES = 420
BAD = {
    "empty": ([], []),
    "no values": (["PV1"], []),
    "too many values": (["PV1"], [1.0, 2.0]),
    "another tag": (["PV9"], [1.0]),
    "NaN": (["PV1"], [float("nan")]),
    "infinite": (["PV1"], [float("inf")]),
    "a tag twice": (["PV1", "PV1"], [1.0, 2.0]),
}


class Sample(NamedTuple):
    """One message of the loop before it is written: topic, stamp in s, value."""

    topic: str
    stamp: float
    value: float


def run(samples: int = SAMPLES, start: float = 0.0, seed: int = 1) -> Iterator[Sample]:
    """Give the messages of a loop that cycles, in their order."""
    record = example1(seed, samples=samples)
    assert record.sp is not None
    for k in range(samples):
        stamp = start + k
        yield Sample("/sp", stamp, float(record.sp[k, 0]))
        yield Sample("/pv", stamp, float(record.pv[k, 0]))
        yield Sample("/op", stamp, float(record.op[k, 0]))


def put(bag: Bag, sample: Sample) -> None:
    tag = "V1" if sample.topic.startswith("/op") else "PV1"
    bag.joint(sample.topic, round(sample.stamp * SECOND), {tag: sample.value})


def one_bad_message(bag: Bag) -> None:
    for sample in run():
        if sample.topic == "/pv" and sample.stamp == 100:
            bag.put("/pv", JOINT_STATE, joint_state(100 * SECOND, ["PV1"], []), 100 * SECOND)
        else:
            put(bag, sample)


def a_pause(bag: Bag) -> None:
    for sample in run():
        if not 80 <= sample.stamp < 120:
            put(bag, sample)


def a_full_disk(bag: Bag) -> None:
    """Now and then a message found room, first of one topic, then of another."""
    random = np.random.default_rng(4)
    for sample in run():
        if not 80 <= sample.stamp < 120 or random.random() < 0.2:
            put(bag, sample)


def a_restarted_plant(bag: Bag) -> None:
    """The answers to the last samples of the old run come when the new one has begun."""
    old, new = list(run(100)), list(run(SAMPLES, seed=2))
    late = [sample for sample in old if sample.topic == "/op" and sample.stamp >= 97]
    for sample in [*(s for s in old if s not in late), *new[:5], *late, *new[5:]]:
        put(bag, sample)


FAULTS: dict[str, tuple[Callable[[Bag], None], list[int], str]] = {
    "one bad message": (one_bad_message, [420], "1 bad message of pv left out: 1 with another"),
    "a pause of the recorder": (a_pause, [80, 300], "split at 1 gap"),
    "a disk full for a while": (a_full_disk, [80, 300], "messages of pv or op without the other"),
    "a restarted plant": (a_restarted_plant, [100, 420], "2 runs are told apart: stamps fall back"),
}


@pytest.fixture(params=sorted(FAULTS))
def fault(request: pytest.FixtureRequest, bag: Bag) -> tuple[Path, list[int], str]:
    """A bag with a fault, the samples of its parts, and what is said of it."""
    spoil, samples, said = FAULTS[request.param]
    spoil(bag)
    bag.writer.close()
    return bag.writer.directory, samples, said


def test_identify_takes_the_longest_part_and_says_so(
    fault: tuple[Path, list[int], str], tmp_path: Path
) -> None:
    path, samples, said = fault
    out = tmp_path / "i.json"
    assert main(["identify", str(path), "--na", "2", "--delay", "4:6", "--json", str(out)]) == 0
    found = json.loads(out.read_text())
    notes = " | ".join(found["model"]["notes"])
    assert found["samples"] == max(samples)
    assert said in notes
    assert ("only the longest good part is looked at" in notes) == (len(samples) > 1)
    assert found["valves"][0]["f_s"] == pytest.approx(5.0, abs=0.5)


@pytest.mark.trial
def test_report_shows_all_parts_and_says_so(
    fault: tuple[Path, list[int], str], tmp_path: Path
) -> None:
    path, samples, said = fault
    page = tmp_path / "r.html"
    assert main(["report", str(path), "--out", str(page)]) == 0
    words = re.sub("<[^>]*>", " ", page.read_text())
    assert said in words
    assert f"{max(samples)} samples of 1 s" in words
    assert ("in the part that was looked at" in words) == (len(samples) > 1)


@pytest.mark.parametrize("ending", [".csv", ""])
def test_convert_writes_each_part(
    fault: tuple[Path, list[int], str],
    ending: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if not ending:
        pytest.importorskip("sensor_msgs", reason="the definitions are not installed")
    path, samples, said = fault
    assert main(["convert", str(path), str(tmp_path / f"c{ending}")]) == 0
    assert said in capsys.readouterr().err
    names = ["c"] if len(samples) == 1 else [f"c_{n + 1}" for n in range(len(samples))]
    for name, count in zip(names, samples, strict=True):
        target = tmp_path / f"{name}{ending}"
        again = tmp_path / f"{name}.again.csv"
        assert main(["convert", str(target), str(again)]) == 0
        assert f"{again}: {count} samples of 1 s" in capsys.readouterr().err


def test_a_run_is_read_whatever_happened(fault: tuple[Path, list[int], str]) -> None:
    path, samples, said = fault
    log = read_run(path)
    good = np.count_nonzero(log.record.quality != Quality.BAD)
    assert good == (max(samples) if "runs" in said else sum(samples))
    assert said in " | ".join(log.notes)
    assert len(log.record) == SAMPLES


def test_replay_says_what_it_needs(
    fault: tuple[Path, list[int], str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(fault[0])]) == 2
    assert "holds no configuration of an estimator" in capsys.readouterr().err


@pytest.mark.parametrize("what", sorted(BAD))
@pytest.mark.parametrize("first", [True, False])
def test_a_bad_message_costs_one_sample(bag: Bag, what: str, first: bool) -> None:
    names, values = BAD[what]
    if first:  # before any good one: the tags are not taken from it
        bag.put("/pv", JOINT_STATE, joint_state(0, names, values), 0)
    for k in range(1, 40):
        stamp = k * SECOND
        if k == 20 and not first:
            bag.put("/pv", JOINT_STATE, joint_state(stamp, names, values), stamp)
        else:
            bag.joint("/pv", stamp, {"PV1": float(k)})
        bag.joint("/op", stamp, {"V1": 3.0 * k})
    record = read_bag(bag.writer.directory)
    assert record.outputs == ("PV1",)
    assert len(record) == 39
    assert any(note.startswith("1 bad message of pv left out: 1 ") for note in record.notes)
    held = np.flatnonzero(record.quality == Quality.HELD).tolist()
    assert held == ([] if first else [19])
    np.testing.assert_array_equal(record.pv[:, 0], np.arange(1.0, 40.0))
    np.testing.assert_array_equal(record.op[:, 0], 3.0 * np.arange(1, 40))


def test_a_bag_of_bad_messages_alone_is_refused_with_the_reason(bag: Bag) -> None:
    for k in range(5):
        bag.put("/pv", JOINT_STATE, joint_state(k * SECOND, ["A"], []), k * SECOND)
        bag.joint("/op", k * SECOND, {"V": 1.0})
    with pytest.raises(InputError, match="no usable message of pv; 5 bad messages of pv left out"):
        read_bag(bag.writer.directory)


def test_both_runs_of_a_restarted_plant_are_whole(bag: Bag) -> None:
    a_restarted_plant(bag)
    parts = read_bag_parts(bag.writer.directory)
    for part, (samples, seed) in zip(parts, ((100, 1), (SAMPLES, 2)), strict=True):
        expected = example1(seed, samples=samples)
        assert expected.sp is not None
        assert part.sp is not None
        np.testing.assert_array_equal(part.op, expected.op)
        np.testing.assert_array_equal(part.pv, expected.pv)
        np.testing.assert_array_equal(part.sp, expected.sp)


def test_set_points_in_force_go_on_after_a_restart(bag: Bag) -> None:
    bag.joint("/sp", 0, {"PV1": 7.0})
    for number in range(2):
        for k in range(50):
            bag.joint("/pv", k * SECOND, {"PV1": 1.0 + k % 3})
            bag.joint("/op", k * SECOND, {"V1": 2.0})
            if number == 0 and k == 30:
                bag.joint("/sp", 30 * SECOND + 1, {"PV1": 8.0})
    first, second = read_bag_parts(bag.writer.directory)
    assert first.sp is not None
    assert second.sp is not None
    assert first.sp[:, 0].tolist() == [7.0] * 31 + [8.0] * 19
    assert second.sp[:, 0].tolist() == [8.0] * 50


def test_what_was_applied_is_taken_for_what_was_commanded(bag: Bag) -> None:
    bag.joint("/op_applied", 4 * SECOND, {"V1": 50.0})  # in force before the first sample
    for k in range(5, 45):
        bag.joint("/pv", k * SECOND, {"PV1": 1.0 + k})
        if k not in (20, 21):
            bag.joint("/op", k * SECOND, {"V1": 60.0 + k})
        if k < 44:
            bag.joint("/op_applied", k * SECOND, {"V1": 0.0 if k == 30 else 60.0 + k})
    bag.writer.close()
    record = read_bag(bag.writer.directory)
    expected = 60.0 + np.arange(5.0, 45.0)
    expected[25] = 0.0
    np.testing.assert_array_equal(record.op[:, 0], expected)
    assert record.mask is None
    assert record.notes == (
        "op_applied differs from op at 1 samples and is taken there",
        "no op at 2 samples, op_applied is taken there",
    )


def test_a_run_of_another_sample_time_is_a_part_of_its_own(bag: Bag) -> None:
    for step in (SECOND, SECOND // 2):
        for k in range(60):
            bag.joint("/pv", k * step, {"PV1": 1.0 + k})
            bag.joint("/op", k * step, {"V1": 2.0})
    parts = read_bag_parts(bag.writer.directory)
    assert [(p.sample_time, len(p)) for p in parts] == [(1.0, 60), (0.5, 60)]


def test_too_many_holes_cut_a_record_and_do_not_refuse_it(bag: Bag) -> None:
    for k in range(60):
        if k < 30 or k % 3 == 0:
            bag.joint("/pv", k * SECOND, {"PV1": 1.0 + k})
            bag.joint("/op", k * SECOND, {"V1": 2.0})
    bag.writer.close()
    (part,) = read_bag_parts(bag.writer.directory)
    assert (len(part), part.start) == (31, 0.0)
    assert part.notes == ("9 rows alone between two holes left out",)
