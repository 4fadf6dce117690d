"""Publishers and subscriptions that know whom they serve."""

from __future__ import annotations

from typing import Any

from stiction_ros.nodes.managed import SIGNAL_QOS
from stiction_ros.nodes.peers import Outlet


class Writer:
    """What an outlet asks of a publisher."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def publish(self, message: str) -> None:
        self.said.append(message)

    def wait_for_all_acked(self, _timeout: Any) -> bool:
        self.said.append("waits")
        return True


def waits(patient: bool, messages: int) -> list[int]:
    """Return after how many messages the outlet has waited."""
    writer: Any = Writer()
    outlet = Outlet(writer, (), SIGNAL_QOS, patient)
    for _ in range(messages):
        outlet.publish("one")
    found, count = [], 0
    for word in writer.said:
        count += word == "one"
        if word == "waits":
            found.append(count)
    assert outlet.count == messages
    return found


def test_a_patient_outlet_never_has_more_on_its_way_than_a_writer_keeps() -> None:
    found = waits(True, 1000)
    assert max(b - a for a, b in zip([0, *found], [*found, 1000], strict=True)) < SIGNAL_QOS.depth


def test_in_realtime_nobody_waits_for_readers() -> None:
    assert waits(False, 1000) == []
