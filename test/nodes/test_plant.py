"""The plant node, with the test in the place of its commander."""

import functools
import time
from collections.abc import Callable
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from graph import Graph
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from stiction_ros.nodes import plant as plant_module
from stiction_ros.nodes.shared import managed, peers
from stiction_ros.nodes.shared.managed import SIGNAL_QOS
from stiction_ros.nodes.shared.messages import SECOND, joint_state, to_ns
from stiction_ros.online.health import Noticed


@pytest.fixture(autouse=True)
def _quick_statuses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five statuses a second, and conditions that are shown for half a second."""
    monkeypatch.setattr(managed, "LOOKS", 2)
    monkeypatch.setattr(peers, "GRACE", 0.0)
    monkeypatch.setattr(managed, "Noticed", functools.partial(Noticed, shown=0.5))


class Commander:
    """A plant, and a node that hears it and answers when it is told to."""

    def __init__(self, graph: Graph, name: str = "controller", **values: Any) -> None:
        self.graph = graph
        self.answer: Callable[[int], None] | None = None
        self.seen: dict[str, list[JointState]] = {}
        self.order: list[tuple[str, int]] = []
        self.levels: list[tuple[bytes, str, dict[str, str]]] = []
        self.node = graph.peer(name)
        for topic in ("op_applied", "sp", "pv", "stem"):
            self.node.create_subscription(JointState, topic, self._note(topic), SIGNAL_QOS)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_status, 1000)
        self.op = self.node.create_publisher(JointState, "op", SIGNAL_QOS)
        given = {"model": "example1.loop.yaml", "set_points": "siso.set_points.yaml"}
        self.plant = graph.add("plant", given | {"wait_for": [name]} | values)
        self.plant.start()
        graph.spin_until(lambda: self.seen.get("pv"), "the first pv")

    def _note(self, topic: str) -> Any:
        def note(message: JointState) -> None:
            self.seen.setdefault(topic, []).append(message)
            self.order.append((topic, to_ns(message.header.stamp) // SECOND))
            if topic == "pv" and self.answer is not None:
                self.answer(self.order[-1][1])

        return note

    def _on_status(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            self.levels.append((bytes(status.level), status.message, values))

    def send(self, second: float, op: float = 50.0, frame: str = "/controller") -> None:
        message = joint_state(round(second * SECOND), ["V1"], [op])
        message.header.frame_id = frame
        self.op.publish(message)

    def told(self, level: bytes, text: str) -> Any:
        return lambda: any(one == level and text in said for one, said, _ in self.levels)

    def values(self) -> dict[str, str]:
        return self.levels[-1][2]


def test_what_was_applied_is_told_before_the_next_pv_and_once_before_the_first(
    graph: Graph,
) -> None:
    hand = Commander(graph)
    for second in (1, 2, 3):
        hand.send(second, 40.0 + second)
        graph.spin_until(lambda: len(hand.seen["pv"]) == second + 1, "the next pv")  # noqa: B023
    applied = [(to_ns(m.header.stamp) // SECOND, m.position[0]) for m in hand.seen["op_applied"]]
    assert applied == [(0, 50.0), (1, 41.0), (2, 42.0), (3, 43.0)]
    wanted = [("op_applied", 0), ("pv", 1), ("op_applied", 1), ("pv", 2)]
    assert [one for one in hand.order if one[0] in ("op_applied", "pv")][:4] == wanted


@pytest.mark.parametrize(
    ("frame", "names", "number", "second", "reason"),
    [
        ("/stranger", ["V1"], 1e6, 1, "op of /stranger is refused, /controller commands"),
        ("", ["V1"], 50.0, 1, "a node that bears no name is refused"),
        ("/controller", ["V2"], 50.0, 1, "without a value for each valve"),
        ("/controller", [], 50.0, 1, "without a value for each valve"),
        ("/controller", ["V1"], float("nan"), 1, "not finite"),
        ("/controller", ["V1"], 50.0, 2, "for a sample to come"),
        ("/controller", ["V1"], 50.0, 0, "for a sample long past"),
    ],
)
def test_a_wrong_op_is_refused_and_named_and_stops_nothing(
    graph: Graph, frame: str, names: list[str], number: float, second: int, reason: str
) -> None:
    hand = Commander(graph)
    message = joint_state(second * SECOND, names, [number] * len(names))
    message.header.frame_id = frame
    hand.op.publish(message)
    graph.spin_until(hand.told(b"\x01", reason), "the warning")
    assert hand.plant.plant.sample == 0
    hand.send(1, 45.0)
    graph.spin_until(lambda: hand.plant.plant.sample == 1, "the next sample")
    graph.spin_until(lambda: hand.levels[-1][:2] == (b"\x00", "running"), "the end of the warning")
    assert sum(int(v) for k, v in hand.values().items() if k.startswith("refused_op:")) == 1


def test_two_commanders_of_one_name_are_an_error_and_the_first_op_wins(graph: Graph) -> None:
    hand = Commander(graph)
    twin = graph.plain("controller").create_publisher(JointState, "op", SIGNAL_QOS)
    graph.spin_until(hand.told(b"\x02", "2 nodes called /controller publish op"), "the error")
    graph.spin_until(lambda: twin.get_subscription_count(), "the link")
    hand.send(1, 41.0)
    graph.spin_until(lambda: hand.plant.plant.sample == 1, "the first sample")
    message = joint_state(SECOND, ["V1"], [99.0])
    message.header.frame_id = "/controller"
    twin.publish(message)
    hand.send(2, 42.0)
    graph.spin_until(lambda: hand.plant.plant.sample == 2, "the second sample")
    graph.spin_until(lambda: len(hand.seen["op_applied"]) == 3, "what was applied")
    assert [m.position[0] for m in hand.seen["op_applied"]] == [50.0, 41.0, 42.0]


@pytest.mark.parametrize(
    ("commander", "frame"), [("mpc", "/mpc"), ("/unit1/mpc", "/unit1/mpc"), ("", "/anyone")]
)
def test_the_commander_is_a_parameter(graph: Graph, commander: str, frame: str) -> None:
    hand = Commander(graph, commander=commander)
    hand.send(1, 45.0, frame)
    graph.spin_until(lambda: hand.plant.plant.sample == 1, "the next sample")
    hand.send(2, 99.0, "/other")
    graph.spin_until(hand.told(b"\x01", "op of /other is refused"), "the warning")
    assert hand.plant.plant.sample == 1


# ---- lockstep ----------------------------------------------------------------------------------


def test_a_sample_without_op_is_shown_again(graph: Graph, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plant_module, "AGAIN", 0.0)
    monkeypatch.setattr(plant_module, "UNEASY", 0.0)
    hand = Commander(graph)
    graph.spin_until(lambda: len(hand.seen["pv"]) == 3, "the sample again")
    assert hand.seen["pv"][0] == hand.seen["pv"][2]
    assert hand.order[:6] == [("op_applied", 0), ("sp", 1), ("pv", 1)] * 2
    graph.spin_until(hand.told(b"\x01", "waiting for op from /controller"), "the warning")
    hand.send(1)
    graph.spin_until(lambda: hand.order[-1] == ("pv", 2), "the next sample")


def test_a_run_without_op_ends_with_a_sentence(graph: Graph) -> None:
    hand = Commander(graph, op_timeout=0.2)
    graph.spin_until(lambda: hand.plant.finished, "the end")
    assert "no op from /controller for sample 0 within 0.2 s" in hand.plant.failure
    hand.plant.finish()
    graph.spin_until(hand.told(b"\x02", "no op from /controller"), "the last status")


@pytest.mark.parametrize("back", [False, True])
def test_a_run_ends_when_a_partner_has_gone_or_is_another(graph: Graph, back: bool) -> None:
    hand = Commander(graph)
    hand.send(1)
    graph.executor.remove_node(hand.node)
    graph.nodes.remove(hand.node)
    hand.node.destroy_node()
    if back:
        graph.peer("controller")
    graph.spin_until(lambda: hand.plant.finished, "the end")
    assert hand.plant.failure.startswith("controller ")
    assert "start all nodes again" in hand.plant.failure


# ---- realtime ----------------------------------------------------------------------------------


def test_a_stopped_loop_is_an_error_and_over_when_op_comes(graph: Graph) -> None:
    hand = Commander(graph, pace="realtime", speed=20.0)
    graph.spin_until(hand.told(b"\x02", "no op from /controller"), "the error")
    hand.answer = hand.send
    graph.spin_until(lambda: hand.levels[-1][0] == b"\x00", "the end of the error")


def test_times_from_pv_to_op_are_told_and_late_ones_counted(graph: Graph) -> None:
    hand = Commander(graph, pace="realtime", speed=20.0)

    def answer(second: int) -> None:
        if second == 7:
            hand.send(6)
        if second != 6:
            hand.send(second)

    hand.answer = answer
    graph.spin_until(hand.told(b"\x01", "op comes after its sample has passed"), "the warning")
    graph.spin_until(lambda: hand.levels[-1][0] == b"\x00", "the end of it")
    told = hand.values()
    found = [float(told[f"pv_to_op_ms_{name}"]) for name in ("p50", "p99", "p999", "max")]
    assert found == sorted(found)
    assert found[0] > 0.0
    assert found[-1] > 5.0  # the late one: the sample after it was shown already
    assert int(told["late_op"]) >= 1


def test_an_op_that_is_refused_as_late_counts_among_the_times(graph: Graph) -> None:
    hand = Commander(graph, pace="realtime", speed=20.0)
    graph.spin_until(lambda: len(hand.seen["pv"]) == 8, "eight samples")
    hand.send(1)
    graph.spin_until(hand.told(b"\x01", "for a sample long past"), "the refusal")
    assert hand.plant.round_trips.answered == 1
    assert hand.plant.round_trips.longest > 0.3


def test_ticks_keep_to_a_grid_of_wall_time_and_missed_ones_are_counted(graph: Graph) -> None:
    hand = Commander(graph, pace="realtime", speed=50.0)
    node = hand.plant
    grid = node._grid
    first, begin, missed = node.plant.sample, grid.due, grid.missed
    graph.spin_until(lambda: node.plant.sample >= first + 10, "ten samples")
    ticks = (grid.due - begin) / grid.period - (grid.missed - missed)
    assert ticks == pytest.approx(node.plant.sample - first, abs=1e-6)
    time.sleep(0.2)  # what a callback that takes long does to the executor
    before, missed = node.plant.sample, grid.missed
    graph.spin_until(lambda: grid.missed >= missed + 8, "the ticks that were missed")
    assert node.plant.sample <= before + 2
    graph.spin_until(hand.told(b"\x01", "the plant is slower than its speed"), "the warning")


def test_another_speed_is_taken_in_mid_run(graph: Graph) -> None:
    hand = Commander(graph, pace="realtime", speed=1.0)
    (answer,) = hand.plant.set_parameters([Parameter("speed", value=50.0)])
    assert answer.successful
    graph.spin_until(lambda: hand.plant.plant.sample > 5, "samples")
