"""A tag that the server refuses keeps back its own loop, is named, and is tried again."""

import time
from collections.abc import Callable, Iterator, Mapping

import pytest
from plant_process import wait_until
from small_maps import BEAT, MODE, OP, PV, REQUEST, ROUT, SP, good, loop_tags
from small_server import SPACE, SmallServer

from stiction_ros.opcua import plant_link
from stiction_ros.opcua.grant import GrantState
from stiction_ros.opcua.loop_bridge import BridgeRules, LoopBridge, WriteOrder
from stiction_ros.opcua.plant_link import (
    Heard,
    Linked,
    LinkEvent,
    OpcuaNodeSettings,
    PlantLink,
    Refused,
    Written,
)
from stiction_ros.opcua.tag_map import Use

UNKNOWN = "is refused (BadNodeIdUnknown)"


class Listener:
    """A link, and what it has told so far."""

    def __init__(
        self, server: SmallServer, read: tuple[str, ...], written: Mapping[str, Use]
    ) -> None:
        settings = OpcuaNodeSettings(url=server.url, security="none", publishing=0.02)
        self.link = PlantLink(settings, read, written)
        self.events: list[LinkEvent] = []
        self.link.start()

    def wait_for(self, what: Callable[[LinkEvent], bool]) -> LinkEvent:
        def found() -> list[LinkEvent]:
            self.events += self.link.drain()
            return [event for event in self.events if what(event)]

        return wait_until(found, "an event")[-1]  # type: ignore[no-any-return]

    def refused(self) -> list[Refused]:
        self.events += self.link.drain()
        return [event for event in self.events if isinstance(event, Refused)]


@pytest.fixture(scope="module")
def server() -> Iterator[SmallServer]:
    found = SmallServer(PV=(1.0, "Double"), OP=(40.0, "Double"), REQUEST=(0, "Int32"))
    yield found
    found.close()


@pytest.fixture
def listen(
    server: SmallServer, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[..., Listener]]:
    made: list[Listener] = []
    monkeypatch.setattr(plant_link, "ASKED_AGAIN", 0.2)

    def begin(read: tuple[str, ...], written: Mapping[str, Use] | None = None) -> Listener:
        made.append(Listener(server, read, written or {}))
        return made[-1]

    yield begin
    for one in made:
        one.link.stop()


def is_heard(tag: str) -> Callable[[LinkEvent], bool]:
    return lambda event: isinstance(event, Heard) and event.tag == tag


def test_the_other_tags_are_heard_and_the_refused_ones_once_they_are_there(
    server: SmallServer, listen: Callable[..., Listener]
) -> None:
    pv, wrong, foreign = "ns=2;s=PV", "ns=2;s=PVX", "nsu=urn:other;s=PV"
    listener = listen((pv, wrong, foreign))
    listener.wait_for(lambda event: isinstance(event, Linked) and event.connected)
    listener.wait_for(is_heard(pv))
    (told,) = listener.refused()
    assert told.tags == {wrong: UNKNOWN, foreign: "is of no namespace of the server, urn:other"}
    server.add("PVX", 7.0, "Double")
    first = listener.wait_for(is_heard(wrong))
    assert isinstance(first, Heard)
    assert (first.reading.value, first.reading.first) == (7.0, True)
    assert set(listener.refused()[-1].tags) == {foreign}
    assert not any(isinstance(one, Linked) and not one.connected for one in listener.events)


def test_a_written_tag_that_is_not_there_is_named_and_the_others_are_written(
    server: SmallServer, listen: Callable[..., Listener]
) -> None:
    request, wrong = f"nsu={SPACE};s=REQUEST", "ns=2;s=RUIN"
    listener = listen(("ns=2;s=PV",), {wrong: Use.OP, request: Use.REQUEST})
    listener.wait_for(lambda event: isinstance(event, Linked) and event.connected)
    (told,) = listener.refused()
    assert told.tags == {wrong: UNKNOWN}
    until = time.monotonic() + 60.0
    orders = [
        WriteOrder("A", Use.OP, ((wrong, 50.0),), until),
        WriteOrder("B", Use.REQUEST, ((request, 1.0),), until),
    ]
    listener.link.submit(orders)
    listener.wait_for(lambda event: isinstance(event, Written) and event.order.loop == "B")
    failures = {one.order.loop: one.failure for one in listener.events if isinstance(one, Written)}
    assert failures == {"A": f"tag {wrong} is refused", "B": ""}
    assert server.value("REQUEST") == 1


def test_a_node_under_two_spellings_is_written_for_the_first_loop_only(
    server: SmallServer, listen: Callable[..., Listener]
) -> None:
    first, second = f"nsu={SPACE};s=OP", "ns=2;s=OP"
    written = {first: Use.OP, "ns=2;s=REQUEST": Use.REQUEST, second: Use.OP}
    listener = listen(("ns=2;s=PV",), written)
    listener.wait_for(lambda event: isinstance(event, Linked) and event.connected)
    (told,) = listener.refused()
    assert told.tags == {second: f"is the node of {first}, which is written already"}
    until = time.monotonic() + 60.0
    for loop, tag, op in (("A", first, 50.0), ("B", second, 60.0)):
        listener.link.submit([WriteOrder(loop, Use.OP, ((tag, op),), until)])
    listener.wait_for(lambda event: isinstance(event, Written) and event.order.loop == "B")
    assert server.value("OP") == 50.0


def test_a_written_tag_of_a_type_that_does_not_fit_is_refused_before_anything_is_asked(
    server: SmallServer, listen: Callable[..., Listener]
) -> None:
    kinds = {"TEXT": ("flow", "String"), "FLAG": (False, "Boolean"), "SHORT": (0, "Int16")}
    for name, (value, kind) in kinds.items():
        server.add(name, value, kind)
    written = {"ns=2;s=TEXT": Use.OP, "ns=2;s=FLAG": Use.REQUEST, "ns=2;s=SHORT": Use.BEAT}
    listener = listen(("ns=2;s=PV",), written)
    listener.wait_for(lambda event: isinstance(event, Linked) and event.connected)
    (told,) = listener.refused()
    assert told.tags == {
        "ns=2;s=TEXT": "is of type String, and an OP is a number",
        "ns=2;s=SHORT": "is of type Int16, and a heartbeat is a whole number of 32 bits",
    }


def bridge_of(writes: bool) -> LoopBridge:
    bridge = LoopBridge(loop_tags(), BridgeRules(writes=writes, asks=True), 0.0)
    for tag, value in ((PV, 10.0), (SP, 10.0), (OP, 40.0), (MODE, "AUTO")):
        bridge.hear(tag, good(value, -0.1, first=True), 0.0)
    bridge.linked(True, 0.0)
    return bridge


@pytest.mark.parametrize("tag", [PV, MODE, ROUT, REQUEST, BEAT])
def test_a_loop_does_not_ask_while_one_of_its_tags_is_refused(tag: str) -> None:
    bridge = bridge_of(writes=True)
    assert bridge.refuse({tag: UNKNOWN, "s=OTHER": UNKNOWN}, 1.0) == []
    assert bridge.refused == (f"tag {tag} {UNKNOWN}",)
    assert bridge.grant.reason == f"waits: tag {tag} {UNKNOWN}"
    bridge.refuse({}, 2.0)
    assert bridge.refused == ()
    assert UNKNOWN not in bridge.grant.reason


def test_a_loop_that_only_listens_minds_only_what_it_reads() -> None:
    bridge = bridge_of(writes=False)
    bridge.refuse({SP: UNKNOWN, ROUT: UNKNOWN}, 1.0)
    assert bridge.refused == (f"tag {SP} {UNKNOWN}",)
    assert bridge.grant.state is GrantState.LISTENING
