"""A cascade in one graph: each controller in its namespace, against the plant without ROS."""

import json
import shutil
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from graph import Graph
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from stiction_ros.cli.main import main
from stiction_ros.config_files import find_config
from stiction_ros.nodes.controller import ControllerNode
from stiction_ros.nodes.plant import PlantNode
from stiction_ros.nodes.shared.managed import LATCHED_QOS, READER_QOS
from stiction_ros.online.replays.result import Match
from stiction_ros.online.replays.run import replay
from stiction_ros.online.session import LiveRun
from stiction_ros.online.unit import UnitScenario, run_unit

SAMPLES = 60
LOOPS = ("LC1", "FC1")
KINDS = {"plant": PlantNode, "controller": ControllerNode}
Seen = dict[str, list[Any]]


@pytest.fixture(scope="module")
def scenario() -> UnitScenario:
    return UnitScenario.load(find_config("cascade.scenario.yaml"))


@pytest.fixture(scope="module")
def seen(scenario: UnitScenario) -> Iterator[Seen]:
    graph, heard, built = Graph(), defaultdict(list), {}
    probe = graph.plain()
    for topic in [f"{loop}/{name}" for loop in LOOPS for name in ("pv", "sp", "op", "stem")]:
        probe.create_subscription(JointState, topic, heard[topic].append, READER_QOS)
    for loop in LOOPS:
        topic = f"{loop}/mode"
        probe.create_subscription(String, topic, heard[topic].append, LATCHED_QOS)
    for name, values in scenario.nodes.items():
        space, _, kind = name.rpartition("/")
        if kind in ("recorder", "estimator"):  # no fit is due within so few samples
            continue
        told = dict(values) | ({"samples": SAMPLES, "seed": 5} if kind == "plant" else {})
        told["wait_for"] = [o for o in values["wait_for"] if "plant" in o or "controller" in o]
        overrides = [Parameter(key, value=value) for key, value in told.items()]
        node = KINDS[kind](
            context=graph.context, namespace=f"/{space}", parameter_overrides=overrides
        )
        built[name] = graph.adopt(node)
    for node in built.values():
        node.start()
        assert node.failure == ""
    graph.spin_until(lambda: built["plant"].finished, "the plant's last sample")
    graph.spin_some()
    yield heard
    graph.close()


@pytest.fixture(scope="module")
def twin(scenario: UnitScenario) -> dict[str, LiveRun]:
    return run_unit(scenario, samples=SAMPLES, seed=5, identify=False)


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("topic", ["pv", "sp", "op"])
def test_the_numbers_are_those_without_ros_bit_for_bit(
    seen: Seen, twin: dict[str, LiveRun], loop: str, topic: str
) -> None:
    at_last = {(m.header.stamp.sec, m.header.stamp.nanosec): m for m in seen[f"{loop}/{topic}"]}
    found = np.array([list(message.position) for message in at_last.values()])
    assert np.array_equal(found, getattr(twin[loop].run.record, topic))


def test_only_a_loop_with_a_valve_of_the_plant_has_a_stem(seen: Seen) -> None:
    assert len(seen["FC1/stem"]) == SAMPLES
    assert seen["LC1/stem"] == []


@pytest.mark.parametrize("loop", LOOPS)
def test_each_loop_has_a_mode_of_its_own(seen: Seen, loop: str) -> None:
    assert [message.data for message in seen[f"{loop}/mode"]] == ["unaware"]


def test_loops_that_do_not_fit_the_plant_are_refused(scenario: UnitScenario) -> None:
    graph = Graph()
    values = dict(scenario.nodes["plant"]) | {"loops": ["FC1: FV9 -> F1"]}
    node = graph.add("plant", values)
    node.start()
    assert "FV9 is not of the plant" in node.failure
    graph.close()


def small(folder: Path) -> Path:
    """Write a cascade that is swapped at sample 905, and return its file."""
    for file in find_config("cascade.scenario.yaml").parent.glob("cascade*"):
        shutil.copy(file, folder)
    (folder / "cascade.set_points.yaml").write_text(
        "repeat: 1000.0\nmoves: [{time: 0.0, F1: 50.0, L1: 50.0}, {time: 100.0, L1: 50.5}]\n"
    )
    path = folder / "cascade.scenario.yaml"
    nodes = yaml.safe_load(path.read_text(encoding="utf-8"))
    schedule = {"fit_first": 600, "fit_every": 300}
    nodes["plant"]["ros__parameters"]["samples"] = 1600
    nodes["/**/controller"]["ros__parameters"] |= schedule
    nodes["/**/estimator"]["ros__parameters"] |= schedule | {"window": 900}
    path.write_text(yaml.safe_dump(nodes), encoding="utf-8")
    return path


@pytest.mark.trial
def test_a_demo_of_several_loops_is_recorded_replayed_and_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["demo", str(small(tmp_path)), "--out", str(tmp_path / "out")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Service FV1 and 2 loops stop cycling." in said
    folder = tmp_path / "out" / "cascade"
    for loop in LOOPS:
        assert replay(folder / "bag", namespace=loop).match is Match.EQUAL
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["swapped"] == "FC1"
    assert summary["neighbours"]["sources"] == {"FC1": "FV1"}
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "disturbed by FC1" in page
