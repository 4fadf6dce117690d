"""The whole graph in one process against the same loop without ROS."""

import dataclasses
import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import yaml
from graph import Graph

from stiction_ros.config_files import find_config
from stiction_ros.loop import read_valve_changes
from stiction_ros.nodes.shared.messages import SECOND, to_ns
from stiction_ros.online.session import LiveRun, Scenario, run_live

SAMPLES = 150
SCHEDULE = {"fit_first": 120, "fit_every": 1000, "fit_latency": 5}
OTHERS = ["controller", "estimator", "recorder"]
CHANGES = "[{time: 60.0, valve: V1, effects: [{effect: stiction, law: he, f_s: 2.0, f_d: 1.0}]}]"


def parameters(node: str) -> dict[str, Any]:
    document = yaml.safe_load(find_config("siso.scenario.yaml").read_text())
    return dict(document[node]["ros__parameters"])


@pytest.fixture(scope="module")
def run() -> Iterator[Graph]:
    """Plant, controller and estimator; a listener stands in for the recorder."""
    graph = Graph()
    graph.listen("recorder")
    nodes = {
        "plant": parameters("plant") | {"samples": SAMPLES, "seed": 4, "valve_changes": CHANGES},
        "controller": parameters("controller") | SCHEDULE,
        "estimator": parameters("estimator")
        | SCHEDULE
        | {"window": 120, "delay_low": 5, "delay_high": 5},
    }
    built = {name: graph.add(name, values) for name, values in nodes.items()}
    for node in built.values():
        node.start()
        assert node.failure == ""
    graph.spin_until(lambda: built["plant"].finished, "the plant's last sample")
    graph.spin_until(lambda: len(graph.seen["prediction"]) == SAMPLES, "every prediction")
    for node in built.values():
        node.finish()
    graph.spin_some()
    graph.arrived = {topic: len(messages) for topic, messages in graph.seen.items()}
    for topic in ("pv", "sp", "op"):
        graph.seen[topic][:] = without_repeats(graph.seen[topic])
    yield graph
    graph.close()


@pytest.fixture(scope="module")
def twin() -> LiveRun:
    scenario = Scenario.load(find_config("siso.scenario.yaml"))
    estimator = dataclasses.replace(
        scenario.estimator, window=120, delay_low=5, delay_high=5, **SCHEDULE
    )
    controller = dataclasses.replace(scenario.controller, **SCHEDULE)
    changes = read_valve_changes(CHANGES, scenario.plant.valve_names)
    scenario = dataclasses.replace(
        scenario, estimator=estimator, controller=controller, valve_changes=changes
    )
    return run_live(scenario, samples=SAMPLES, seed=4)


def without_repeats(messages: list[Any]) -> list[Any]:
    """Leave out repeats: on a busy machine the plant shows PV again after a second without OP.

    The controller answers a repeated PV with the same OP.
    """
    pairs = itertools.pairwise(messages)
    return messages[:1] + [then for now, then in pairs if then != now]


def stamps(messages: list[Any]) -> list[int]:
    return [to_ns(m.header.stamp) for m in messages]


@pytest.mark.parametrize("topic", ["pv", "sp", "op", "stem", "prediction"])
def test_every_sample_has_one_message_with_its_stamp(run: Graph, topic: str) -> None:
    assert stamps(run.seen[topic]) == [(1 + k) * SECOND for k in range(SAMPLES)]


def test_the_clock_shows_every_sample(run: Graph) -> None:
    times = [to_ns(m.clock) for m in run.seen["/clock"]]
    assert times == [(1 + k) * SECOND for k in range(SAMPLES)]


@pytest.mark.parametrize("topic", ["pv", "sp", "op", "stem"])
def test_the_numbers_are_those_without_ros_bit_for_bit(
    run: Graph, twin: LiveRun, topic: str
) -> None:
    expected = getattr(twin.run.record, topic)
    found = np.array([list(m.position) for m in run.seen[topic]])
    assert np.array_equal(found, expected)


def test_the_valve_changes_at_its_time(run: Graph) -> None:
    """The stem, after a change of friction, stays within the new f_S of OP."""
    op, stem = (np.array([m.position[0] for m in run.seen[t]]) for t in ("op", "stem"))
    assert np.abs(op - stem)[:60].max() > 2.0
    assert np.abs(op - stem)[60:].max() <= 2.0


@pytest.mark.parametrize(
    ("topic", "names"), [("pv", ["PV1"]), ("sp", ["PV1"]), ("op", ["V1"]), ("stem", ["V1"])]
)
def test_messages_name_their_tags(run: Graph, topic: str, names: list[str]) -> None:
    assert all(list(m.name) == names for m in run.seen[topic])


def test_a_prediction_begins_now_and_holds_outputs_and_stems(run: Graph, twin: LiveRun) -> None:
    for k, message in enumerate(run.seen["prediction"]):
        assert list(message.joint_names) == ["PV1", "V1"]
        first, *rest = message.points
        assert (first.time_from_start.sec, first.time_from_start.nanosec) == (0, 0)
        assert first.positions[1] == twin.stem_estimate[k, 0]
        assert len(rest) == 10
        assert rest[-1].time_from_start.sec == 60


def test_the_first_mode_is_told_once(run: Graph) -> None:
    assert [m.data for m in run.seen["mode"]] == ["unaware"]


def test_each_fit_is_told_at_the_end_of_its_window(run: Graph) -> None:
    (message,) = run.seen["stiction"]
    assert to_ns(message.header.stamp) == SCHEDULE["fit_first"] * SECOND
    if message.name:
        assert list(message.name) == ["V1.f_s", "V1.f_d"]
        for low, value, high in zip(
            message.velocity, message.position, message.effort, strict=True
        ):
            assert low <= value <= high


def test_published_counts_are_what_arrived(run: Graph) -> None:
    last: dict[str, str] = {}
    for message in run.seen["/diagnostics"]:
        for status in message.status:
            if status.name.endswith(": status"):
                for item in status.values:
                    if item.key.startswith("published:"):
                        node = status.name.partition(":")[0]
                        last[f"{node} {item.key}"] = item.value
    arrived = {
        "plant published:/pv": "pv",
        "plant published:/sp": "sp",
        "plant published:/stem": "stem",
        "plant published:/clock": "/clock",
        "controller published:/op": "op",
        "controller published:/prediction": "prediction",
        "controller published:/mode": "mode",
        "estimator published:/stiction": "stiction",
    }
    assert {key: int(last[key]) for key in arrived} == {
        key: run.arrived[topic] for key, topic in arrived.items()
    }
    diagnostics = [int(v) for key, v in last.items() if key.endswith("/diagnostics")]
    assert sum(diagnostics) == len(run.seen["/diagnostics"])


def test_the_start_is_told_with_mode_model_and_reason(run: Graph) -> None:
    told = [
        (to_ns(message.header.stamp), {item.key: item.value for item in status.values})
        for message in run.seen["/diagnostics"]
        for status in message.status
        if status.name == "controller: mode"
    ]
    assert [stamp for stamp, _ in told] == [SECOND]
    assert told[0][1].items() >= {"mode": "unaware", "reason": "start"}.items()
    assert "model" in told[0][1]


def test_configuration_is_told_once_with_parameters_version_and_model(run: Graph) -> None:
    (message,) = run.seen["controller/config"]
    document = yaml.safe_load(message.data)
    assert document["parameters"]["horizon"] == 60
    assert document["version"]
    assert document["model"]["loop"] == "example1_process"
