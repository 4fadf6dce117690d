"""The window of a running loop: what lacks is filled by the rule of files and bags."""

import numpy as np
import pytest

from stiction_ros.online.window import Window
from stiction_ros.records.regular import HELD


def filled(count: int, lacking: set[int], longest: int = 100) -> Window:
    window = Window("unit", ("V1",), ("PV1",), 2.0, longest)
    for k in range(count):
        pv = np.nan if k in lacking else float(k)
        window.add(np.array([10.0 * k]), np.array([pv]))
    return window


def test_a_pv_that_lacks_lies_between_its_neighbours_and_op_is_as_given() -> None:
    record = filled(80, {40, 41, 42}).record(79)
    assert record.pv[:, 0].tolist() == list(range(80))
    assert record.op[:, 0].tolist() == [10.0 * k for k in range(80)]


def test_one_at_the_end_is_held() -> None:
    assert filled(50, {49}).record(49).pv[-2:, 0].tolist() == [48.0, 48.0]


@pytest.mark.parametrize(("many", "kept"), [(HELD, 90), (HELD + 1, 90 - 60 - HELD - 1)])
def test_with_one_more_in_a_row_the_window_begins_anew(many: int, kept: int) -> None:
    window = filled(90, set(range(60, 60 + many)))
    assert len(window) == kept
    assert window.record(89).start == 2.0 * (90 - kept)


def test_not_more_than_the_slight_share_of_a_window_is_filled() -> None:
    assert len(filled(60, set(range(19, 60, 10)))) == 60
    assert len(filled(60, set(range(30, 60, 5)))) < 60
    assert len(filled(400, set(range(100, 400, 10)))) == 100  # the share of what is still held


def test_another_length_keeps_the_last() -> None:
    window = filled(50, set())
    window.resize(20)
    assert window.record(49).pv[:, 0].tolist() == list(range(30, 50))
    window.keep(5)
    assert window.record(49).pv[:, 0].tolist() == list(range(45, 50))
