"""One loop bridged: samples out, OP written under the grant, lost at every fault."""

import dataclasses

import numpy as np
import pytest
from small_maps import ALIVE, BEAT, MODE, OP, PV, ROUT, SP, bad, good, loop_tags

from stiction_ros.online.input.op_port import Reception
from stiction_ros.opcua.grant import GrantState
from stiction_ros.opcua.loop_bridge import (
    BridgeRules,
    HeardBeat,
    LoopBridge,
    WriteOrder,
    beat_of,
    identity_of,
    mode_text,
)
from stiction_ros.opcua.sampling import TagQuality, TagReading
from stiction_ros.opcua.tag_map import Use, ValveTags

SENDER = "/unit/controller"
RULES = BridgeRules(writes=True, asks=True, commander=SENDER, identity=3)


class Plant:
    """A control system as the bridge sees it; wall and plant time are the same but for an offset.

    Every order is carried out at once, unless ``refuses`` says why not.
    """

    def __init__(self, rules: BridgeRules = RULES, **tags: object) -> None:
        self.bridge = LoopBridge(loop_tags(**tags), rules, 0.0)
        self.now = 0.0
        self.mode, self.op, self.pv, self.alive = "AUTO", 40.0, 10.0, 0
        self.beats = True
        self.linked = True
        self.refuses = ""
        self.took = 0.01
        self.unanswered: set[Use] = set()  # what is never told to have been written
        self.orders: list[WriteOrder] = []
        for tag, value in ((PV, 10.0), (SP, 10.0), (OP, self.op), (MODE, self.mode)):
            self.hear(tag, good(value, -0.1, first=True))
        self.hear(BEAT, good(0.0, -0.1, first=True))

    def hear(self, tag: str, reading: TagReading) -> None:
        self.do(self.bridge.hear(tag, reading, self.now))

    def do(self, orders: list[WriteOrder]) -> None:
        for order in orders:
            self.orders.append(order)
            if order.kind in self.unanswered:
                continue
            if order.kind is Use.OP and not self.refuses:
                self.op = order.values[0][1]
                self.hear(OP, good(self.op, self.now))
            self.do(self.bridge.written(order, self.refuses, self.took, self.now))

    def run(self, seconds: int, wanted: float | None = 50.0, sender: str = SENDER) -> None:
        for _ in range(seconds):
            self.now += 1.0
            self.alive += self.beats
            if self.linked:
                self.hear(ALIVE, good(float(self.alive), self.now))
                self.hear(PV, good(self.pv, self.now))
                self.hear(OP, good(self.op, self.now))
            self.do(self.bridge.linked(self.linked, self.now))
            for sample in self.bridge.samples(self.now):
                if wanted is not None:
                    op = np.array([wanted])
                    _, orders = self.bridge.command(sender, sample.stamp, op, self.now)
                    self.do(orders)
            self.do(self.bridge.look(self.now))

    def set_mode(self, mode: str) -> None:
        self.mode = mode
        self.hear(MODE, good(mode, self.now))

    def granted(self) -> "Plant":
        self.run(10)
        assert self.bridge.grant.state is GrantState.ASKED, self.bridge.grant
        self.set_mode("ROUT")
        self.run(3)
        assert self.bridge.grant.may_write, self.bridge.grant
        return self

    def ops(self) -> list[float]:
        return [order.values[0][1] for order in self.orders if order.kind is Use.OP]

    def requests(self) -> list[float]:
        return [order.values[0][1] for order in self.orders if order.kind is Use.REQUEST]


def test_listening_writes_nothing_whatever_is_asked() -> None:
    plant = Plant(dataclasses.replace(RULES, writes=False, asks=True))
    plant.run(10)
    plant.set_mode("ROUT")
    plant.run(10)
    assert plant.bridge.ask() == "writing is off"
    assert plant.orders == []


def test_nothing_but_request_and_beat_is_written_before_the_grant() -> None:
    plant = Plant()
    plant.run(20)
    assert plant.requests() == [1.0]
    assert {order.kind for order in plant.orders} == {Use.REQUEST, Use.BEAT}


def test_op_begins_where_it_is_and_moves_at_the_rate() -> None:
    plant = Plant().granted()
    plant.run(10, wanted=90.0)
    ops = plant.ops()
    assert ops[0] == 40.0
    assert np.abs(np.diff([40.0, *ops])).max() <= 2.0 + 1e-9  # %/s, samples of 1 s
    assert ops[-1] > 55.0


def test_ops_that_the_rate_cuts_are_told() -> None:
    plant = Plant().granted()
    plant.run(10, wanted=plant.op)
    watch = plant.bridge.rate_watch
    before = plant.bridge.counts["op_cut_by_rate"]
    assert before > 0  # the way from the OP in force to what was wanted first
    plant.run(60, wanted=plant.op)
    assert watch.text() == ""
    plant.run(4, wanted=plant.op + 9.2)
    assert plant.bridge.counts["op_cut_by_rate"] == before + 4
    assert watch.text() == (
        "OP of V1 is cut by the map's rate of 2 %/s at 4 of the last 60 samples; "
        "the controller wanted steps up to 9.2 %"
    )
    plant.set_mode("AUTO")
    plant.run(3)
    plant.bridge.ask()
    plant.granted()
    assert watch.text() == ""  # a new grant, on its way to what is wanted


def test_op_never_leaves_its_limits() -> None:
    plant = Plant().granted()
    plant.run(60, wanted=400.0)
    assert max(plant.ops()) == 100.0
    plant.run(120, wanted=-400.0)
    assert min(plant.ops()) == 0.0


def test_an_op_that_is_not_taken_in_time_ends_the_grant() -> None:
    plant = Plant().granted()
    plant.unanswered.add(Use.OP)
    plant.run(1)
    written = len(plant.ops())
    assert plant.bridge.grant.may_write
    plant.run(3)
    assert plant.bridge.grant.reason == "the server does not take an OP in time"
    assert plant.requests() == [1.0, 0.0]
    assert len(plant.ops()) == written


def test_the_mode_is_asked_for_at_the_moment_of_writing() -> None:
    plant = Plant().granted()
    order = next(order for order in plant.orders if order.kind is Use.OP)
    assert (order.modes, order.granted) == ((MODE,), ("ROUT",))
    assert order.values[0][0] == ROUT


def test_only_the_commander_is_written_for() -> None:
    plant = Plant().granted()
    before = len(plant.ops())
    plant.run(2, sender="/unit/other")
    assert len(plant.ops()) == before
    assert plant.bridge.op_port.counts[Reception.NAME] == 2


def taken_back(plant: Plant) -> None:
    plant.set_mode("AUTO")


def bad_mode(plant: Plant) -> None:
    plant.hear(MODE, TagReading("ROUT", TagQuality.BAD, good(0.0, plant.now).stamp))


def bad_pv(plant: Plant) -> None:
    plant.pv = float("nan")


def bad_op(plant: Plant) -> None:
    plant.hear(OP, bad(plant.now + 0.5))
    plant.do(plant.bridge.look(plant.now))


def cut(plant: Plant) -> None:
    plant.linked = False


def no_plant_beat(plant: Plant) -> None:
    plant.beats = False


def other_writer(plant: Plant) -> None:
    plant.hear(BEAT, good(float(beat_of(77, 1)), plant.now))


def refused(plant: Plant) -> None:
    plant.refuses = "BadUserAccessDenied"


def slow(plant: Plant) -> None:
    plant.took = 4.0


def beyond(plant: Plant) -> None:
    plant.op = 100.5
    plant.hear(OP, good(plant.op, plant.now))


@pytest.mark.parametrize(
    ("fault", "seconds"),
    [
        (taken_back, 0),
        (bad_mode, 0),
        (bad_op, 0),
        (cut, 1),
        (beyond, 1),
        (other_writer, 1),
        (refused, 1),
        (slow, 1),
        (bad_pv, 4),
        (no_plant_beat, 6),
    ],
)
def test_every_fault_ends_writing_and_tells_why(fault: object, seconds: int) -> None:
    plant = Plant().granted()
    fault(plant)  # type: ignore[operator]
    plant.run(seconds)
    grant = plant.bridge.grant
    assert grant.state is GrantState.IDLE, grant
    assert grant.reason
    plant.refuses, plant.took, plant.linked = "", 0.01, True
    written = len(plant.ops())
    plant.run(10)
    assert len(plant.ops()) == written
    assert plant.bridge.grant.state is GrantState.IDLE
    if fault is not other_writer:
        assert plant.requests()[-1] == 0.0


def test_without_a_commander_the_plant_takes_over() -> None:
    plant = Plant().granted()
    plant.run(5, wanted=None)
    assert plant.bridge.grant.reason == f"no op from {SENDER}"
    assert plant.requests() == [1.0, 0.0]


def test_it_can_be_asked_for_again() -> None:
    plant = Plant().granted()
    plant.set_mode("AUTO")
    plant.run(3)
    assert plant.bridge.ask() == ""
    plant.run(3)
    assert plant.bridge.grant.state is GrantState.ASKED
    plant.op = 61.0
    plant.set_mode("ROUT")
    plant.run(3, wanted=61.5)
    assert plant.ops()[-3] == 61.0  # bumpless again


def test_a_request_that_is_still_being_taken_back_is_not_made_anew() -> None:
    plant = Plant().granted()
    plant.unanswered.add(Use.REQUEST)
    plant.set_mode("AUTO")
    assert plant.orders[-1].values[0][1] == 0.0
    taking_back = plant.orders[-1]
    plant.bridge.ask()
    plant.set_mode(ROUT)  # a grant of the request that still stands there
    assert plant.bridge.grant.state is GrantState.IDLE
    assert "being taken back" in plant.bridge.grant.reason
    plant.set_mode("AUTO")
    plant.unanswered.clear()
    plant.do(plant.bridge.written(taking_back, "", 0.01, plant.now))
    plant.run(1)
    assert plant.bridge.grant.state is GrantState.ASKED
    assert plant.requests()[-2:] == [0.0, 1.0]


def test_a_pending_ask_waits_until_it_can_be_made_or_is_taken_back() -> None:
    plant = Plant()
    plant.run(60, wanted=None)  # twelve times the watchdog's time
    assert plant.bridge.grant.reason == f"waits: no op from {SENDER}"
    assert plant.bridge.grant.wanted
    plant.do(plant.bridge.give_back(plant.now, "given back by service"))
    assert not plant.bridge.grant.wanted
    plant.run(10)
    assert plant.orders == []
    assert plant.bridge.grant.reason == "given back by service"
    assert plant.bridge.ask() == ""
    plant.run(1)
    assert plant.bridge.grant.state is GrantState.ASKED


def test_a_writer_that_is_there_already_is_waited_for() -> None:
    plant = Plant()
    for k in range(12):
        plant.hear(BEAT, good(float(beat_of(77, k)), plant.now))
        plant.run(1)
    assert plant.orders == []
    assert "another" in plant.bridge.grant.reason
    plant.run(8)
    assert plant.bridge.grant.state is GrantState.ASKED


def test_a_give_back_of_another_one_is_not_made() -> None:
    plant = Plant().granted()
    plant.linked = False
    plant.run(2)
    plant.linked = True
    plant.hear(BEAT, good(float(beat_of(77, 1)), plant.now))
    plant.run(2)
    assert plant.requests() == [1.0]  # the request is the other one's by now


def test_limits_of_the_plant_that_are_crossed_are_told_as_such() -> None:
    valve = ValveTags("V1", OP, ROUT, MODE, low="s=LOW", high="s=HIGH")
    plant = Plant(valves=(valve,))
    for tag, value in (("s=LOW", 80.0), ("s=HIGH", 20.0)):
        plant.hear(tag, good(value, 0.0, first=True))
    plant.run(10)
    assert plant.bridge.grant.reason == "waits: limits of V1 are 80 to 20"
    assert plant.orders == []
    plant.hear("s=LOW", good(10.0, 11.0))
    plant.hear("s=HIGH", good(30.0, 11.0))
    plant.run(1)
    assert plant.bridge.grant.reason == "waits: OP in force beyond its limits"


def test_beats_bear_the_writer() -> None:
    beats = [beat_of(7, k) for k in range(70_000)]
    assert {identity_of(float(one)) for one in beats} == {7}
    assert len(set(beats[:65_536])) == 65_536
    assert identity_of(-1.0) == -1
    assert identity_of(0.0) == 0


def test_a_first_report_is_no_beat() -> None:
    heard = HeardBeat()
    heard.hear(5.0, 1.0, first=True)
    assert heard.changed_at == -np.inf
    heard.hear(6.0, 5.0, first=False)
    assert heard.changed_at == 5.0


@pytest.mark.parametrize(
    ("value", "text"), [("ROUT", "ROUT"), (4.0, "4"), (4.5, ""), (None, ""), (float("inf"), "")]
)
def test_modes_are_names_or_whole_numbers(value: object, text: str) -> None:
    assert mode_text(value) == text  # type: ignore[arg-type]
