"""The estimator's monitor in a graph, against the same without ROS."""

import dataclasses
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from graph import Graph
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

sys.path.insert(0, str(Path(__file__).parents[1] / "online"))
from monitored_loops import ONSET, RULE, WATCHED, loop, record, shifted

from stiction_ros.nodes.shared.managed import SIGNAL_QOS
from stiction_ros.nodes.shared.messages import SECOND, joint_state
from stiction_ros.online.monitor.gap_monitor import GapMonitor
from stiction_ros.texts import json_text

SAMPLES, LOOKS = 1120, 12
NEVER = {"fit_first": 100_000, "fit_every": 100_000}
SHIFTED = record(shifted(), SAMPLES)


class Feed:
    """Publishes the samples of the loop whose sensor shifts."""

    def __init__(self, graph: Graph, **values: Any) -> None:
        self.graph = graph
        self.estimator = graph.add("estimator", {"loop": "watched", **NEVER, **values})
        self.estimator.start()
        assert self.estimator.failure == ""
        node = graph.plain()
        self.pv = node.create_publisher(JointState, "pv", SIGNAL_QOS)
        self.op = node.create_publisher(JointState, "op", SIGNAL_QOS)
        graph.spin_until(
            lambda: self.pv.get_subscription_count() and self.op.get_subscription_count(), "readers"
        )
        graph.spin_until(lambda: self.estimator.running, "the start")

    @property
    def taken(self) -> int:
        return int(self.estimator.estimator.samples)

    def show(self, first: int, last: int) -> None:
        for k in range(first, last):
            stamp = (k + 1) * SECOND
            self.pv.publish(joint_state(stamp, ["PV1"], SHIFTED.pv[k]))
            self.op.publish(joint_state(stamp, ["V1"], SHIFTED.op[k]))
            self.graph.spin_until(lambda k=k: self.taken == k + 1, f"sample {k}")


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    graph = Graph()
    graph.listen("recorder")
    model = tmp_path_factory.mktemp("watched") / "known.loop.yaml"
    loop().save(model)
    feed = Feed(graph, **dataclasses.asdict(RULE), monitor_model=str(model))
    feed.show(0, SAMPLES)
    graph.spin_until(lambda: told(graph, "finding"), "the finding")
    feed.estimator.report()
    graph.spin_until(lambda: len(told(graph, "look")) == LOOKS, "every measurement")
    graph.spin_some()
    yield graph
    graph.close()


@pytest.fixture(scope="module")
def twin() -> dict[str, list[dict[str, Any]]]:
    """What the monitor says of the same samples without ROS."""
    monitor = GapMonitor(RULE, *WATCHED, loop())
    looks = [monitor.add(k, SHIFTED.op[k], SHIFTED.pv[k]) for k in range(SAMPLES)]
    said = {"look": [look for look in looks if look], "finding": monitor.collect()}
    return {
        key: [json.loads(json_text(one.to_dict(), indent=None)) for one in found]
        for key, found in said.items()
    }


def told(graph: Graph, key: str) -> list[dict[str, Any]]:
    """Return the documents in statuses of the estimator with that key."""
    return [json.loads(values[key]) for _, values in statuses(graph, None) if key in values]


def statuses(graph: Graph, task: str | None) -> list[tuple[Any, dict[str, str]]]:
    """Return the estimator's statuses of one task, or all, with their values."""
    return [
        (status, {item.key: item.value for item in status.values})
        for message in graph.seen["/diagnostics"]
        for status in message.status
        if status.name.startswith("estimator: ") and task in (None, status.name[11:])
    ]


@pytest.mark.trial
@pytest.mark.parametrize("key", ["look", "finding"])
def test_what_is_told_is_what_is_said_without_ros_bit_for_bit(
    graph: Graph, twin: dict[str, list[dict[str, Any]]], key: str
) -> None:
    assert told(graph, key) == twin[key]


@pytest.mark.trial
def test_it_is_silent_before_the_shift_and_warns_after_it(graph: Graph) -> None:
    levels: dict[int, bytes] = {}
    for status, values in statuses(graph, "monitor"):
        if "window_end" in values:
            levels[int(values["window_end"]) // SECOND - 1] = status.level
    assert {level for end, level in levels.items() if end < ONSET} == {b"\x00"}
    assert {level for end, level in levels.items() if end > ONSET} == {b"\x01"}


@pytest.mark.trial
def test_the_status_names_the_shift_with_figures_per_output(graph: Graph) -> None:
    status, values = statuses(graph, "monitor")[-1]
    assert "bias step of the sensor of PV1" in status.message
    assert values["verdict"] == "ambiguous"
    assert float(values["PV1.growth"]) > float(values["PV1.limit"]) > 1.0
    assert float(values["PV1.gap"]) > float(values["PV1.baseline"]) > 0.0


@pytest.mark.trial
def test_the_configuration_tells_the_model_that_is_compared_with(graph: Graph) -> None:
    (message,) = graph.seen["estimator/config"]
    assert yaml.safe_load(message.data)["model"]["loop"] == "watched"


@pytest.fixture
def alone() -> Iterator[Graph]:
    graph = Graph()
    yield graph
    graph.close()


@pytest.mark.trial
def test_it_can_be_turned_on_while_the_node_runs(alone: Graph, tmp_path: Path) -> None:
    alone.listen("recorder")
    loop().save(tmp_path / "known.loop.yaml")
    rule = dataclasses.asdict(RULE) | {"monitor": False}
    feed = Feed(alone, **rule, monitor_model=str(tmp_path / "known.loop.yaml"))
    feed.show(0, 2)
    feed.estimator.report()
    (answer,) = feed.estimator.set_parameters([Parameter("monitor", value=True)])
    assert answer.successful
    feed.show(2, 4)
    feed.estimator.report()
    alone.spin_until(lambda: statuses(alone, "monitor"), "the status")
    status, _ = statuses(alone, "monitor")[0]
    assert (status.level, status.message) == (b"\x00", "no measurement yet")


@pytest.mark.parametrize(("name", "value"), [("monitor_window", 10), ("monitor_false_alarm", 0.5)])
def test_a_value_out_of_range_is_refused_and_the_old_one_kept(
    alone: Graph, name: str, value: float
) -> None:
    node = alone.add("estimator")
    node.start()
    before = getattr(node.settings, name)
    (answer,) = node.set_parameters([Parameter(name, value=value)])
    assert not answer.successful
    assert getattr(node.settings, name) == before


def test_a_model_that_is_not_there_is_one_clear_error(alone: Graph) -> None:
    node = alone.add("estimator", {"monitor_model": "nowhere.loop.yaml"})
    node.start()
    assert node.failure.startswith("nowhere.loop.yaml: no such file")
