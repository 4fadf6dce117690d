from __future__ import annotations

import numpy as np

from stiction_ros.online.inbox import Inbox, SetPointPreview

ONE, TWO, THREE = (np.array([v]) for v in (1.0, 2.0, 3.0))
STEP = 10


def test_a_sample_needs_the_set_point_of_its_stamp() -> None:
    inbox = Inbox(scheduled=True, needs_dv=False)
    inbox.add_pv(100, ONE)
    inbox.add_sp(90, TWO)
    assert inbox.first() is None
    inbox.add_sp(100, THREE)
    found = inbox.first()
    assert found is not None
    assert (found.stamp, found.pv.tolist(), found.sp.tolist()) == (100, [1.0], [3.0])
    assert found.dv is None


def test_without_a_schedule_the_last_set_point_holds() -> None:
    inbox = Inbox(scheduled=False, needs_dv=False)
    inbox.add_sp(5, TWO)
    inbox.add_pv(100, ONE)
    found = inbox.first()
    assert found is not None
    assert found.sp.tolist() == [2.0]


def test_measured_disturbances_are_waited_for_where_they_are_needed() -> None:
    inbox = Inbox(scheduled=False, needs_dv=True)
    inbox.add_sp(5, TWO)
    inbox.add_pv(100, ONE)
    assert inbox.first() is None
    inbox.add_dv(100, THREE)
    found = inbox.first()
    assert found is not None
    assert found.dv is not None
    assert found.dv.tolist() == [3.0]


def test_samples_come_oldest_first_and_once() -> None:
    inbox = Inbox(scheduled=False, needs_dv=False)
    inbox.add_sp(5, TWO)
    for stamp in (110, 100):
        inbox.add_pv(stamp, ONE)
    stamps = []
    while (found := inbox.first()) is not None:
        stamps.append(found.stamp)
        inbox.used(found)
    assert stamps == [100, 110]


def test_a_preview_holds_each_set_point_until_the_next() -> None:
    preview = SetPointPreview((120, 140), np.array([[2.0], [3.0]]))
    assert preview.ahead(ONE, 100, STEP, 6).ravel().tolist() == [1, 2, 2, 3, 3, 3]


def test_what_a_preview_says_of_the_past_is_over() -> None:
    preview = SetPointPreview((120, 140), np.array([[2.0], [3.0]]))
    assert preview.ahead(ONE, 120, STEP, 4).ravel().tolist() == [1, 3, 3, 3]
    assert preview.ahead(ONE, 500, STEP, 2).ravel().tolist() == [1, 1]
