"""Publishers and subscriptions that know whom they serve."""

import itertools
from typing import Any

from stiction_ros.nodes.shared.managed import SIGNAL_QOS
from stiction_ros.nodes.shared.peers import Outlet


class Writer:
    """What an outlet asks of a publisher."""

    def __init__(self, heard: bool = True) -> None:
        self.heard = heard
        self.said = 0
        self.waits: list[tuple[int, int]] = []  # messages said before, nanoseconds

    def publish(self, _message: str) -> None:
        self.said += 1

    def wait_for_all_acked(self, timeout: Any) -> bool:
        self.waits.append((self.said, timeout.nanoseconds))
        return self.heard


def speak(writer: Any, messages: int, *, waits: bool) -> Outlet:
    outlet = Outlet(writer, (), SIGNAL_QOS, waits=waits)
    for _ in range(messages):
        outlet.publish("one")
    assert outlet.count == messages
    return outlet


def test_a_patient_outlet_never_has_more_on_its_way_than_a_writer_keeps() -> None:
    writer = Writer()
    speak(writer, 1000, waits=True)
    said = [0, *(count for count, _ in writer.waits), 1000]
    assert max(b - a for a, b in itertools.pairwise(said)) < SIGNAL_QOS.depth
    assert all(nanoseconds > 0 for _, nanoseconds in writer.waits)


def test_in_realtime_nobody_waits_for_readers() -> None:
    writer = Writer()
    speak(writer, 1000, waits=False)
    assert not writer.waits


def test_who_lets_a_node_wait_in_vain_is_not_waited_for_until_it_has_received() -> None:
    writer = Writer(heard=False)
    outlet = speak(writer, 300, waits=True)
    assert [nanoseconds > 0 for _, nanoseconds in writer.waits] == [True] + 5 * [False]
    writer.heard = True
    for _ in range(100):
        outlet.publish("one")
    assert [nanoseconds > 0 for _, nanoseconds in writer.waits[6:]] == [False, True]
