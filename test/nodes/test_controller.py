"""The controller node among messages that come late, wrong, or not at all."""

import time
from typing import Any

import numpy as np
import pytest
from graph import BUDGET, Graph
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.nodes import controller as controller_module
from stiction_ros.nodes.shared.managed import LATCHED_QOS, SIGNAL_QOS
from stiction_ros.nodes.shared.messages import joint_state, to_ns
from stiction_ros.online.health import Noticed

S = 10**9
OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"
NAN = float("nan")
KNOWN = find_config("example1.loop.yaml").read_text(encoding="utf-8")


class Clock:
    """The receiver's clock, which the test moves."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 1000.0
        fake = type("Time", (), {"monotonic": lambda: self.now})
        monkeypatch.setattr(controller_module, "time", fake)


class Bench:
    """The test in the place of a plant in realtime: it tells what is applied, and shows PV."""

    def __init__(self, graph: Graph, monkeypatch: pytest.MonkeyPatch, **parameters: Any) -> None:
        self.graph, self.clock = graph, Clock(monkeypatch)
        graph.listen("listener")
        self.node = graph.add(
            "controller",
            {
                "model": "example1_process.loop.yaml",
                "pace": "realtime",
                "fit_first": 10**6,
                "autostart": False,
            }
            | parameters,
        )
        self.node.noticed = Noticed(lambda: self.clock.now)
        self.node.start()
        assert self.node.failure == ""
        self.probe = graph.plain()
        self.out = {
            topic: self.probe.create_publisher(JointState, topic, SIGNAL_QOS)
            for topic in ("pv", "sp", "op_applied", "dv")
        }
        self.model = self.probe.create_publisher(String, "loop_model", LATCHED_QOS)
        self.op = graph.seen["op"]
        graph.spin_until(self._is_linked, "the links")

    def _is_linked(self) -> bool:
        return (
            all(p.get_subscription_count() >= 1 for p in (*self.out.values(), self.model))
            and self.node._op.publisher.get_subscription_count() >= 1
            and self.node.running
        )

    def send(self, topic: str, stamp: float, value: float, name: str = "") -> None:
        tag = name or {"pv": "PV1", "sp": "PV1", "op_applied": "V1", "dv": "D1"}[topic]
        self.out[topic].publish(joint_state(round(stamp * S), [tag], [value]))

    def queued(self, count: int) -> None:
        """Wait until ``count`` PV lie in the node's queue, without serving it."""
        self.graph.spin_some(0)
        end = time.monotonic() + BUDGET
        while time.monotonic() < end:
            self.node.drain_signals()
            if len(self.node.port._queue) >= count:
                return
        raise AssertionError(f"{len(self.node.port._queue)} of {count} came")

    def stepped(self, stamp: float) -> JointState:
        """Spin until the op of ``stamp`` is there and return it."""

        def found() -> list[JointState]:
            return [op for op in self.op if to_ns(op.header.stamp) == round(stamp * S)]

        self.graph.spin_until(found, f"op of {stamp:g} s")
        return found()[-1]

    def show(self, stamp: float) -> None:
        """Show a PV and spin until the node has looked at it."""
        pace = self.node.port.pace
        self.send("pv", stamp, 50.0)
        self.graph.spin_until(lambda: (pace._before or (0, 0))[1] == round(stamp * S), "pv")

    def sample(self, stamp: float, pv: float = 50.0, applied: float | None = None) -> JointState:
        """Show one sample and return its op; the valve was given the last one."""
        self.clock.now += 1.0
        last = self.op[-1].position[0] if self.op else 50.0
        self.send("op_applied", stamp - 1, last if applied is None else applied)
        self.send("sp", stamp, 50.0)
        self.send("pv", stamp, pv)
        return self.stepped(stamp)

    def wait(self, seconds: float, step: float = 0.2) -> None:
        """Let time pass, as the node sees it, while it looks what is due."""
        for _ in range(round(seconds / step)):
            self.clock.now += step
            self.node._go_on_without()

    def calm(self, first: int) -> None:
        """Show samples from ``first`` on, until what was noticed is over."""
        for k in range(first, first + 4):
            self.sample(k)
            self.node.look()

    def status(self) -> Any:
        """Return what the node says of itself now."""
        self.node._go_on_without()
        self.node.look()
        self.node.report()
        count = str(self.node._diagnostics.count)

        def last() -> Any:
            for message in reversed(self.graph.seen["/diagnostics"]):
                for item in message.status[0].values:
                    if (item.key, item.value) == ("published:/diagnostics", count):
                        return message.status[0]
            return None

        self.graph.spin_until(last, "diagnostics")
        return last()

    def keys(self) -> dict[str, str]:
        return {item.key: item.value for item in self.status().values}

    @property
    def stamps(self) -> list[float]:
        return [to_ns(op.header.stamp) / S for op in self.op]


@pytest.fixture
def bench(graph: Graph, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(graph, monkeypatch)


def test_the_first_op_is_near_the_one_in_force(bench: Bench) -> None:
    assert bench.sample(1, pv=49.0, applied=63.0).position[0] == pytest.approx(63.0, abs=1.0)
    assert bench.status().level == OK


def test_op_names_its_commander(bench: Bench) -> None:
    assert bench.sample(1).header.frame_id == "/controller"


def test_where_nobody_tells_the_run_begins_with_the_third_pv(bench: Bench) -> None:
    bench.send("sp", 1, 50.0)
    for k in (1, 2, 3):
        bench.clock.now += 1.0
        bench.show(k)
    assert bench.stepped(3).position[0] == pytest.approx(50.0)
    assert bench.stamps == [3.0]


def test_of_a_backlog_only_the_newest_is_answered(bench: Bench) -> None:
    bench.sample(1)
    bench.clock.now += 113.0
    for k in range(2, 115):
        bench.send("op_applied", k - 1, 50.0)
        bench.send("pv", k, 50.2)
    bench.queued(113)
    bench.node.go()
    bench.stepped(114)
    assert bench.stamps == [1.0, 114.0]
    told = bench.status()
    assert told.level == WARN
    assert "112 samples behind" in told.message
    bench.sample(115)
    assert bench.keys()["samples_behind"] == "0"
    bench.clock.now += 0.5
    assert bench.keys()["passed_over"] == "112"
    assert bench.node.port.next == 115


def test_sp_of_another_stamp_stale_swapped_and_wrong_messages_stop_nothing(bench: Bench) -> None:
    bench.sample(1)
    bench.send("pv", 0, 50.0)
    bench.send("sp", 7.3, 50.0)
    bench.send("pv", 1, 50.0)
    bench.send("pv", 2e9, 50.0)
    bench.send("pv", 2, 50.0, "OTHER")
    bench.out["pv"].publish(JointState(name=["PV1"]))
    bench.graph.spin_until(lambda: bench.node.port.counts["ahead"], "the future")
    bench.clock.now += 1.0
    bench.send("pv", 2, 50.0)
    bench.stepped(2)
    bench.sample(3)
    told = bench.status()
    assert told.level == WARN
    assert "stamps of the past" in told.message
    bench.calm(4)
    assert bench.status().level == OK


def test_a_plant_that_begins_anew_with_older_stamps_is_followed(bench: Bench) -> None:
    for k in (500, 501):
        bench.sample(k)
    for k in range(1, 10):
        bench.clock.now += 1.0
        bench.send("op_applied", k - 1, 30.0)
        bench.show(k)
    first = bench.sample(10, applied=30.0)
    assert first.position[0] == pytest.approx(30.0)
    bench.sample(11)
    assert bench.keys()["new_runs"] == "1"


def test_values_out_of_range_move_no_valve(bench: Bench) -> None:
    usual = [bench.sample(k, 50.0 + 0.01 * k).position[0] for k in range(1, 8)]
    wild = [bench.sample(k, 1e6).position[0] for k in range(8, 14)]
    largest = max(abs(np.diff(usual)))
    assert max(abs(np.diff([usual[-1], *wild]))) <= 1.1 * largest + 1e-9
    bench.send("sp", 14, 1e9)
    bench.clock.now += 1.0
    bench.send("pv", 14, 50.08)
    bench.stepped(14)
    told = bench.keys()
    assert (told["out_of_range"], told["refused_sp"]) == ("6", "1")


def test_without_pv_the_plan_goes_on_and_the_stop_is_said(bench: Bench) -> None:
    bench.sample(1)
    bench.wait(3.2)
    told = bench.status()
    assert told.level == ERROR
    assert "no pv for" in told.message
    bench.stepped(3)
    assert bench.stamps == [1.0, 2.0, 3.0]
    bench.wait(1.0)
    assert bench.stepped(4).header.frame_id == "/controller"
    bench.calm(5)
    assert bench.status().level == OK


def test_without_a_set_point_the_node_says_so(bench: Bench) -> None:
    for k in range(1, 5):
        bench.clock.now += 1.0
        bench.send("op_applied", k - 1, 50.0)
        bench.send("pv", k, 50.0)
        bench.graph.spin_until(lambda k=k: bench.node.port.waiting == k, "pv")
    told = bench.status()
    assert (told.level, bench.op) == (ERROR, [])
    assert "sp lacks" in told.message


def test_after_a_pause_what_queued_up_is_not_answered(bench: Bench) -> None:
    bench.sample(1, applied=40.0)
    bench.node.trigger_deactivate()
    for k in range(2, 30):
        bench.send("pv", k, 50.0)
        bench.send("op_applied", k, 70.0)
    bench.clock.now += 29.0
    bench.graph.spin_some()
    assert bench.node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    bench.graph.spin_until(lambda: bench.node.running, "the node to run again")
    assert bench.sample(31, applied=70.0).position[0] == pytest.approx(70.0)
    assert bench.stamps == [1.0, 31.0]


def test_two_commanders_are_an_error_that_names_both(bench: Bench) -> None:
    bench.sample(1)
    stranger = bench.graph.plain("stranger")
    publisher = stranger.create_publisher(JointState, "op", SIGNAL_QOS)

    def said() -> str:
        bench.node._looks = 0
        bench.node.look()
        bench.graph.spin_some(1)
        return bench.node.noticed.text

    bench.graph.spin_until(lambda: "op is published by" in said(), "the second commander")
    assert "/controller" in said()
    assert "/stranger" in said()
    assert bench.status().level == ERROR
    stranger.destroy_publisher(publisher)
    topic = bench.node.resolve_topic_name("op")
    bench.graph.spin_until(
        lambda: len(bench.node.get_publishers_info_by_topic(topic)) == 1, "the stranger to go"
    )
    bench.calm(2)
    assert bench.status().level == OK


HOSTILE = {
    "deep": "[" * 5000,
    "long": KNOWN + "# " * 100_000,
    "aliases": "a: &a [1]\n" + "".join(f"k{i}: [*a, *a]\n" for i in range(1000)),
    "keys": "\n".join(f"k{i}: 1" for i in range(5000)),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_hostile_loop_model_is_refused_beside_the_loop(
    bench: Bench, case: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    submit, given = bench.node.background.submit, []

    def note(*work: Any) -> Any:
        given.append(submit(*work))
        return given[-1]

    monkeypatch.setattr(bench.node.background, "submit", note)
    bench.sample(1)
    bench.model.publish(String(data=HOSTILE[case]))
    bench.graph.spin_until(lambda: given, "the model")
    bench.sample(2)
    assert isinstance(given[0].exception(timeout=BUDGET), InputError)
    bench.graph.spin_until(lambda: not bench.node.reading, "the refusal")
    assert bench.node.live._offered is None
    bench.sample(3)
    assert [c.mode.value for c in bench.node.live.changes] == ["unaware"]


def test_a_loop_model_is_taken_in_realtime(graph: Graph, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(graph, monkeypatch, hand_over_samples=3, offer_samples=0)
    for k in range(1, 6):
        bench.sample(k)
    bench.model.publish(String(data=f"{KNOWN}\nvalid_from: {6 * S}\n"))
    bench.graph.spin_until(lambda: bench.node.live._offered is not None, "the offer")
    k = 6
    while len(bench.node.live.changes) < 2:
        bench.sample(k)
        k += 1
        assert k < 200
    assert bench.node.live.mode.value == "embedding"
    bench.graph.spin_until(lambda: len(bench.graph.seen["mode"]) == 2, "the mode")
    assert [m.data for m in bench.graph.seen["mode"]] == ["unaware", "embedding"]


def test_simulated_time_that_stands_still_stops_nothing(
    graph: Graph, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(graph, monkeypatch)
    (result,) = bench.node.set_parameters([Parameter("use_sim_time", value=True)])
    assert result.successful
    bench.sample(1)
    bench.graph.spin_until(lambda: bench.node.port._looked, "a look")
    bench.clock.now += 3.2  # the node takes this for a pause of its own
    bench.graph.spin_until(lambda: bench.node.port._awake > 0, "a look after the pause")
    bench.clock.now += 0.15
    bench.graph.spin_until(lambda: 3.0 in bench.stamps, "the sample that did not come")


def test_the_speed_can_be_set(bench: Bench) -> None:
    bench.sample(1)
    (result,) = bench.node.set_parameters([Parameter("speed", value=10.0)])
    assert result.successful
    bench.wait(0.32, 0.08)
    bench.stepped(3)
