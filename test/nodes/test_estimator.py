"""The estimator node, with the test in the place of plant and controller."""

import functools
from collections.abc import Sequence
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from graph import Graph
from sensor_msgs.msg import JointState

from stiction_ros.nodes import estimator
from stiction_ros.nodes.shared import managed
from stiction_ros.nodes.shared.managed import SIGNAL_QOS
from stiction_ros.nodes.shared.messages import SECOND, joint_state
from stiction_ros.online.health import Noticed


@pytest.fixture(autouse=True)
def _quick_statuses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five statuses a second, and conditions that are shown for half a second."""
    monkeypatch.setattr(managed, "LOOKS", 2)
    monkeypatch.setattr(managed, "Noticed", functools.partial(Noticed, shown=0.5))


class Idle:
    """A worker that has nothing to compile, as no window here is ever full."""

    compiled = True

    def __init__(self, methods: Sequence[str]) -> None:
        self.methods = methods

    def close(self) -> None:
        return


@pytest.fixture(autouse=True)
def _no_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(estimator, "FitWorker", Idle)


class Loop:
    """An estimator and the topics that it reads."""

    def __init__(self, graph: Graph, **values: Any) -> None:
        self.graph = graph
        self.told: list[tuple[bytes, str, dict[str, str]]] = []
        probe = graph.plain()
        self.pv = probe.create_publisher(JointState, "pv", SIGNAL_QOS)
        self.op = probe.create_publisher(JointState, "op", SIGNAL_QOS)
        self.applied = probe.create_publisher(JointState, "op_applied", SIGNAL_QOS)
        probe.create_subscription(DiagnosticArray, "/diagnostics", self._on_status, 1000)
        given = {"window": 500, "fit_first": 10**6, "pace": "realtime", "speed": 10.0}
        self.node = graph.add("estimator", given | values)
        self.node.start()
        graph.spin_until(lambda: self.node.running, "the estimator to run")

    def _on_status(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "estimator: status":
                values = {pair.key: pair.value for pair in status.values}
                self.told.append((bytes(status.level), status.message, values))

    def show(self, seconds: Any, pv: float = 1.0, tag: str = "PV1") -> None:
        for second in seconds:
            self.pv.publish(joint_state(second * SECOND, [tag], [pv]))
            self.applied.publish(joint_state(second * SECOND, ["V1"], [50.0]))

    def until(self, sample: int) -> None:
        self.graph.spin_until(lambda: self.node.estimator.samples == sample, f"sample {sample}")

    def says(self, level: bytes, text: str) -> None:
        def said() -> bool:
            return any(one == level and text in told for one, told, _ in self.told)

        self.graph.spin_until(said, text)


def test_a_few_missed_samples_are_filled_and_counted(graph: Graph) -> None:
    loop = Loop(graph)
    loop.show([*range(1, 41), *range(43, 51)])
    loop.until(50)
    assert loop.node.estimator.pairs.counts["missed"] == 2
    assert len(loop.node.estimator.live.window) == 50


@pytest.mark.parametrize("how", ["lost", "nan"])
def test_many_missed_samples_begin_the_window_anew(graph: Graph, how: str) -> None:
    loop = Loop(graph)
    loop.show([1, 2, 3])
    if how == "nan":
        loop.show(range(4, 10), float("nan"))
    loop.show([10, 11])
    loop.until(11)
    assert len(loop.node.estimator.live.window) == 2
    loop.says(b"\x01", "window anew")
    graph.spin_until(lambda: loop.told[-1][2]["missed_samples"] == "6", "the count")


def test_one_stale_or_future_stamp_does_nothing_and_ten_older_ones_are_a_new_run(
    graph: Graph,
) -> None:
    loop = Loop(graph)
    loop.show([1000, 1001, 1002, 5, 10**6, 1003])
    loop.until(4)
    assert len(loop.node.estimator.live.window) == 4
    loop.show(range(1, 13))
    loop.until(16)
    assert len(loop.node.estimator.live.window) == 12
    assert loop.node.estimator.pairs.counts["runs"] == 1


@pytest.mark.parametrize("topic", ["pv", "op_applied", "op"])
def test_messages_without_the_tags_are_counted_and_stop_nothing(graph: Graph, topic: str) -> None:
    loop = Loop(graph)
    loop.show([1])
    loop.until(1)
    writer = {"pv": loop.pv, "op": loop.op, "op_applied": loop.applied}[topic]
    writer.publish(joint_state(2 * SECOND, ["OTHER"], [1.0]))
    writer.publish(JointState(name=["PV1", "V1"]))
    writer.publish(JointState())
    loop.show([2])
    loop.until(2)
    loop.says(b"\x01", "without a value for each tag")
    key = f"refused_{topic.removesuffix('_applied')}"
    graph.spin_until(lambda: loop.told[-1][2].get(key) == "3", "the count")


def test_a_stray_that_came_first_does_not_name_the_tags_for_ever(graph: Graph) -> None:
    loop = Loop(graph)
    loop.pv.publish(joint_state(SECOND, ["OTHER"], [1.0]))
    loop.show(range(2, 30))
    graph.spin_until(lambda: loop.node.estimator.tags["pv"] == ("PV1",), "the true tag")
    graph.spin_until(
        lambda: loop.node.estimator.live and len(loop.node.estimator.live.window) > 10, "samples"
    )


def test_a_loop_that_stops_is_an_error_until_it_goes_on(graph: Graph) -> None:
    loop = Loop(graph)
    loop.show([1, 2])
    loop.says(b"\x02", "no pv")
    shown = [2]

    def over() -> bool:
        if loop.node.estimator.pairs._last >= shown[-1] * SECOND:
            shown.append(shown[-1] + 1)
            loop.show(shown[-1:])
        return loop.told[-1][0] == b"\x00"

    graph.spin_until(over, "the end of the error")


def test_pv_without_op_is_an_error_and_counted_as_behind(graph: Graph) -> None:
    loop = Loop(graph)
    loop.show([1])
    seconds = iter(range(2, 10**6))

    def told() -> bool:
        loop.pv.publish(joint_state(next(seconds) * SECOND, ["PV1"], [1.0]))
        return any(level == b"\x02" and "no op" in text for level, text, _ in loop.told)

    graph.spin_until(told, "the error")
    assert int(loop.told[-1][2]["behind"]) > 3


def test_a_sample_that_is_shown_again_counts_once(graph: Graph) -> None:
    loop = Loop(graph, pace="lockstep")
    loop.show([1, 2, 2, 2, 3])
    loop.until(3)
    assert loop.node.estimator.pairs.counts["repeated"] == 2
    assert len(loop.node.estimator.live.window) == 3
