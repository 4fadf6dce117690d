"""Windows of many loops, filled as their samples come."""

import numpy as np

from stiction_ros.online.loop_windows import LoopWindow
from stiction_ros.records.quality import Quality

SECOND = 1_000_000_000


def filled(count: int, without: tuple[int, ...] = (), window: int = 100) -> LoopWindow:
    loop = LoopWindow("unit", 1.0, window)
    for k in range(count):
        if k not in without:
            loop.add_applied((k - 1) * SECOND, ("V1",), np.array([40.0 + k - 1]))
            loop.add_pv(k * SECOND, ("PV1",), np.array([10.0 + k]))
    return loop


def test_samples_become_a_record() -> None:
    loop = filled(50)
    record = loop.record()
    assert record is not None
    assert loop.missed == 0
    np.testing.assert_array_equal(record.op[:, 0] - record.pv[:, 0], 30.0)
    assert record.start == 0.0
    assert len(record) == 49  # the OP of the last sample is still to come


def test_the_window_keeps_the_last() -> None:
    loop = filled(300, window=100)
    record = loop.record()
    assert record is not None
    assert (len(loop), len(record), loop.samples) == (100, 100, 299)
    assert record.pv[-1, 0] == 10.0 + 298


def test_a_gap_is_counted_and_the_record_begins_behind_it() -> None:
    loop = filled(60, (30, 31))
    record = loop.record()
    assert record is not None
    assert loop.missed == 2
    assert record.start == 32.0


def test_bad_samples_are_marked() -> None:
    loop = filled(20)
    loop.add_applied(19 * SECOND, ("V1",), np.array([59.0]))
    loop.add_pv(20 * SECOND, ("PV1",), np.array([np.nan]))
    loop.add_applied(20 * SECOND, ("V1",), np.array([60.0]))
    loop.add_pv(21 * SECOND, ("PV1",), np.array([31.0]))
    loop.add_applied(21 * SECOND, ("V1",), np.array([61.0]))
    record = loop.record()
    assert record is not None
    assert np.flatnonzero(record.quality == Quality.BAD).tolist() == [20]


def test_other_tags_are_left_alone() -> None:
    loop = filled(10)
    loop.add_pv(10 * SECOND, ("PV2",), np.array([1.0]))
    assert loop.samples == 9


def test_too_little_is_no_record() -> None:
    assert LoopWindow("unit", 1.0, 10).record() is None
