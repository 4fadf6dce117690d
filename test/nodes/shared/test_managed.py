"""What all nodes share, tried on a small node of its own."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from graph import Graph
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from stiction_ros.nodes.shared import managed, peers
from stiction_ros.nodes.shared.managed import LATCHED_QOS, SIGNAL_QOS, ManagedNode
from stiction_ros.nodes.shared.messages import joint_state
from stiction_ros.nodes.shared.peers import Peers
from stiction_ros.online.plain_settings import NodeSettings
from stiction_ros.settings import setting


@dataclasses.dataclass(frozen=True)
class PacedSettings(NodeSettings):
    pace: str = setting("lockstep", "of the loop", fixed=True)


class Small(ManagedNode):
    """Reads pv of the plant, writes op to it."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("small", PacedSettings, **kwargs)
        self.busy = ""
        self.taken: list[JointState] = []

    def configure(self) -> None:
        self.op = self.outlet(JointState, "op", SIGNAL_QOS, ("plant",))
        self.inlet(JointState, "pv", self.taken.append, SIGNAL_QOS, ("plant",))

    def preparing(self) -> str:
        return self.busy


@pytest.fixture
def graph() -> Iterator[Graph]:
    built = Graph()
    yield built
    built.close()


def small(graph: Graph, *wait_for: str, **values: Any) -> Small:
    given = {"wait_for": list(wait_for) or [""]} | values
    overrides = [Parameter(key, value=value) for key, value in given.items()]
    return graph.adopt(Small(context=graph.context, parameter_overrides=overrides))


def plant(graph: Graph) -> Any:
    """A plain node in the plant's place that announces itself and uses both topics."""
    node = graph.peer("plant")
    node.create_subscription(JointState, "op", lambda _message: None, SIGNAL_QOS)
    node.pv = node.create_publisher(JointState, "pv", SIGNAL_QOS)
    return node


def warnings(node: Small, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    said: list[str] = []

    class Logger:
        warning = error = info = staticmethod(said.append)

    monkeypatch.setattr(node, "get_logger", Logger)
    return said


@pytest.fixture(autouse=True)
def _no_grace(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "GRACE", 0.0)


# ---- who must be there -------------------------------------------------------------------------


def test_only_what_lacks_is_named_and_why(graph: Graph, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(managed, "LINK_PATIENCE", 0.0)
    monkeypatch.setattr(managed, "LINK_REMINDER", 0.0)
    node = small(graph, "plant", "pump", "recorder")
    said = warnings(node, monkeypatch)
    graph.peer("pump")
    node.start()
    graph.spin_until(lambda: said, "the first warning")
    assert "plant (no such node)" in said[0]
    assert "pump" not in said[0]

    mute = graph.plain("plant")
    writer = mute.create_publisher(JointState, "pv", SIGNAL_QOS)
    graph.spin_until(
        lambda: "plant (not ready)" in said[-1] and "plant (does not read op)" in said[-1],
        "what lacks of the plant",
    )
    mute.create_subscription(JointState, "op", lambda _message: None, SIGNAL_QOS)
    mute.create_publisher(String, "~/config", LATCHED_QOS)
    graph.spin_until(
        lambda: said[-1].startswith("still waiting for recorder (no such node); see"),
        "the recorder alone",
    )
    assert writer is not None


def test_a_node_says_that_it_is_ready_and_with_whom(
    graph: Graph, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = small(graph, "plant", "topic:pv")
    said = warnings(node, monkeypatch)
    plant(graph)
    node.start()
    graph.spin_until(lambda: node.running, "the node to run")
    assert said == ["small is ready: plant, /pv"]


@pytest.mark.parametrize("entry", ["topic:pv", "/pv"])
def test_a_relay_or_driver_of_any_name_satisfies_a_topic(graph: Graph, entry: str) -> None:
    node = small(graph, entry, "topic:op", "topic:level")
    node.start()
    graph.spin_some()
    assert not node.running
    relay = graph.plain("relay")
    relay.create_publisher(JointState, "pv", SIGNAL_QOS)
    graph.spin_some()
    assert not node.running
    relay.create_publisher(JointState, "level", SIGNAL_QOS)
    relay.create_subscription(JointState, "op", lambda _message: None, SIGNAL_QOS)
    graph.spin_until(lambda: node.running, "the node to run")


def test_the_recorder_does_not_stand_for_a_driver(graph: Graph) -> None:
    node = small(graph, "topic:op")
    node.start()
    recorder = graph.plain("recorder")
    recorder.create_subscription(JointState, "op", lambda _message: None, SIGNAL_QOS)
    graph.spin_until(lambda: node.op.publisher.get_subscription_count(), "the match")
    graph.spin_some()
    assert not node.running


def test_a_reader_whose_qos_cannot_match_stops_nobody(graph: Graph) -> None:
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    graph.plain("echo").create_subscription(JointState, "op", lambda _message: None, latched)
    node = small(graph)
    node.start()
    graph.spin_until(lambda: node.running, "the node to run")


def test_a_node_is_not_ready_before_it_is_prepared(graph: Graph) -> None:
    node = small(graph)
    node.busy = "compiling"
    node.start()
    graph.spin_some()
    assert "~/config" not in node.outlets
    node.busy = ""
    graph.spin_until(lambda: node.running, "the node to run")


# ---- steady time -------------------------------------------------------------------------------


@pytest.mark.parametrize("when", ["from the start", "while it runs"])
def test_simulated_time_that_stands_still_stops_no_timer(graph: Graph, when: str) -> None:
    node = small(graph, **({"use_sim_time": True} if when == "from the start" else {}))
    node.start()
    graph.spin_until(lambda: node.running, "the node to run")
    node.set_parameters([Parameter("use_sim_time", value=True)])
    looks = node._looks
    graph.spin_until(lambda: node._looks > looks + 1, "its timers")
    node.trigger_deactivate()
    node.trigger_cleanup()  # must leave the subscription of simulated time alone
    node.set_parameters([Parameter("use_sim_time", value=False)])
    node.start()
    graph.spin_until(lambda: node.running, "the node to run again")


@pytest.mark.parametrize(
    "stopped", [("plant",), ("controller",), ("plant", "controller", "recorder")]
)
def test_a_loop_starts_and_runs_with_simulated_time(
    graph: Graph, stopped: tuple[str, ...], tmp_path: Path
) -> None:
    values: dict[str, dict[str, Any]] = {
        "plant": {"model": "example1.loop.yaml", "set_points": "siso.set_points.yaml"},
        "controller": {"model": "example1_process.loop.yaml", "fit_first": 10**6},
        "recorder": {"directory": str(tmp_path / "bag")},
    }
    values["plant"]["samples"] = 20
    nodes = {}
    for name, given in values.items():
        others = [other for other in values if other != name] if name != "recorder" else [""]
        more = {"wait_for": others, "use_sim_time": name in stopped}
        nodes[name] = graph.add(name, given | more)
        nodes[name].start()
    graph.spin_until(lambda: nodes["plant"].finished, "the last sample")
    assert nodes["plant"].plant.sample == 20


# ---- partners in lockstep ----------------------------------------------------------------------


@pytest.mark.parametrize("back", [False, True])
def test_a_node_in_lockstep_ends_with_the_plant(graph: Graph, back: bool) -> None:
    node = small(graph, "plant")
    first = plant(graph)
    node.start()
    graph.spin_until(lambda: node.running, "the node to run")
    graph.executor.remove_node(first)
    graph.nodes.remove(first)
    first.destroy_node()
    if back:
        plant(graph)
    graph.spin_until(lambda: node.finished, "the end")
    assert (node.running, node.failure) == (False, "")


@pytest.mark.parametrize(
    ("before", "now", "lost"),
    [
        ({1}, {1}, ""),
        ({1}, set(), "has gone"),
        ({1}, {2}, "was replaced"),
        ({1}, {1, 2}, "was replaced"),
        ({1, 2}, {2}, ""),  # the first was killed before the run and is given up now
        ({1, 2}, set(), "has gone"),
    ],
)
def test_what_has_become_of_a_partner(
    graph: Graph, before: set[int], now: set[int], lost: str
) -> None:
    found = Peers(graph.plain(), ["plant", "recorder"])
    there = [frozenset((one,) for one in before)]
    found._announced = lambda _name: there[0]
    found.pin()
    assert found.gone() == {}
    there[0] = frozenset((one,) for one in now)
    assert found.gone() == ({"plant": lost} if lost else {})


def test_a_partner_that_stood_still_for_a_moment_has_not_gone(
    graph: Graph, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, there = [0.0], [frozenset({(1,)})]
    monkeypatch.setattr(peers, "GRACE", 5.0)
    monkeypatch.setattr(peers.time, "monotonic", lambda: now[0])
    found = Peers(graph.plain(), ["plant"])
    found._announced = lambda _name: there[0]
    found.pin()
    for second, present, lost in [(1, 0, 0), (5, 0, 0), (5.5, 1, 0), (9, 0, 0), (14, 0, 1)]:
        now[0], there[0] = second, frozenset({(1,)} if present else ())
        assert bool(found.gone()) is bool(lost)


def test_a_node_in_realtime_goes_on_without_the_plant(graph: Graph) -> None:
    node = small(graph, "plant", pace="realtime")
    first = plant(graph)
    node.start()
    graph.spin_until(lambda: node.running, "the node to run")
    graph.executor.remove_node(first)
    graph.nodes.remove(first)
    first.destroy_node()
    looks = node._looks
    graph.spin_until(lambda: node._looks > looks + managed.LOOKS, "a second")
    assert node.running


# ---- what is noticed ---------------------------------------------------------------------------


def test_what_is_noticed_is_told_at_once_and_no_longer_than_it_lasts(graph: Graph) -> None:
    told: list[tuple[bytes, str]] = []

    def listen(message: DiagnosticArray) -> None:
        told.extend((bytes(status.level), status.message) for status in message.status)

    graph.plain().create_subscription(DiagnosticArray, "/diagnostics", listen, 100)
    node = small(graph)
    node.start()
    graph.spin_until(lambda: told, "the first status")
    assert told[-1] == (b"\x00", "running")
    now = [0.0]
    node.noticed = managed.Noticed(lambda: now[0])
    looks = node._looks
    node.notice("late", "warn", "op is late")
    node.notice("stopped", "error", "no pv")
    graph.spin_until(lambda: (b"\x02", "running; no pv; op is late") in told, "the error")
    assert node._looks <= looks + 2
    now[0] = 10.0
    graph.spin_until(lambda: told[-1] == (b"\x00", "running"), "the end of it")


def test_everything_that_is_queued_is_taken_at_once(graph: Graph) -> None:
    node = small(graph)
    writer = plant(graph).pv
    node.start()
    graph.spin_until(lambda: node.running and writer.get_subscription_count(), "the link")
    for second in range(5):
        writer.publish(joint_state(second * 10**9, ["PV1"], [1.0]))
    while len(node.taken) < 5:
        node.inlets["pv"].drain()
    assert [m.header.stamp.sec for m in node.taken] == [0, 1, 2, 3, 4]
    node.inlets["pv"].drain()
    assert len(node.taken) == 5
