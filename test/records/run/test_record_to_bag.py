from pathlib import Path

import numpy as np
import pytest
from bag_making import JOINT_STATE, STORE, read_bag
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("sensor_msgs", reason="the definitions of sensor_msgs are not installed")

from stiction_ros.errors import InputError
from stiction_ros.records.record import Record
from stiction_ros.records.run.record_to_bag import joint_state_bytes, write_bag

TAGS = st.lists(
    st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9), max_size=5
)


@given(st.integers(0, 2**31 * 10**9 - 1), TAGS, st.data())
def test_other_readers_decode_the_bytes(stamp: int, names: list[str], data: st.DataObject) -> None:
    floats = st.floats(allow_nan=False)
    values = data.draw(st.lists(floats, min_size=len(names), max_size=len(names)))
    found = STORE.deserialize_cdr(joint_state_bytes(stamp, names, values), JOINT_STATE)
    assert found.header.stamp.sec * 10**9 + found.header.stamp.nanosec == stamp
    assert found.header.frame_id == ""
    assert list(found.name) == names
    assert found.position.tolist() == values
    assert len(found.velocity) == len(found.effort) == 0


def record(start: float = 7.25, stem: bool = True) -> Record:
    random = np.random.default_rng(5)
    return Record(
        "loop.csv",
        0.5,
        ("V1", "V2"),
        ("C", "T"),
        random.standard_normal((40, 2)),
        random.standard_normal((40, 2)),
        random.standard_normal((40, 2)),
        random.standard_normal((40, 2)) if stem else None,
        start,
    )


@pytest.mark.parametrize("stem", [True, False])
def test_a_record_comes_back_bit_for_bit(tmp_path: Path, stem: bool) -> None:
    was = record(stem=stem)
    counts = write_bag(was, tmp_path / "bag")
    found = read_bag(tmp_path / "bag")
    assert set(counts.values()) == {40}
    assert (found.valves, found.outputs) == (was.valves, was.outputs)
    assert (found.sample_time, found.start) == (was.sample_time, was.start)
    for key in ("op", "pv", "sp", "stem"):
        one, other = getattr(was, key), getattr(found, key)
        assert (one is None and other is None) or np.array_equal(one, other)


@pytest.mark.parametrize("start", [-1.0, 3e9])
def test_times_that_no_stamp_can_say_are_refused(tmp_path: Path, start: float) -> None:
    with pytest.raises(InputError, match="which no ROS stamp can hold"):
        write_bag(record(start), tmp_path / "bag")
