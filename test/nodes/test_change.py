"""From estimate to swap on two valves, and valves that change, in the graph and without it."""

import dataclasses
from typing import Any

import numpy as np
import pytest
import yaml
from graph import Graph

from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel, read_valve_changes
from stiction_ros.nodes.shared.messages import SECOND, to_ns
from stiction_ros.online.session import LiveRun, Scenario, run_live

QUICK = {"fit_first": 400, "fit_every": 100, "fit_latency": 5}
TANK = {"fit_first": 310, "fit_every": 62, "fit_latency": 5}
GROWN = "[{time: 540.0, valve: V1, effects: [{effect: stiction, law: he, f_s: 7.5, f_d: 2.0}]}]"
LAWS = {  # figures of f_S = 5 %, f_D = 2 %
    "kano": "s: 7.0, j: 3.0",
    "choudhury": "s: 7.0, j: 3.0",
    "xch": "f_s: 5.0, f_d: 2.0",
}
SERVICED = "[{time: 540.0, valve: V1, effects: []}]"

# A controller that moves often: a change shows after few samples.
OFTEN: dict[str, Any] = {
    "kick_limits": (1000.0,),
    "move_worth": (0.0,),
    "embedding_move_weights": (0.002,),
    "look_ahead": 0,
}

# scenario, schedule of the fits, window, changes, samples, modes after the first
CASES = {
    "tank": ("tank", TANK, 620, "", 390, ["embedding"]),
    "serviced": ("siso", QUICK, 500, SERVICED, 920, ["embedding", "unaware"]),
    "grown": ("siso", QUICK, 500, GROWN, 720, ["embedding", "embedding", "embedding"]),
}
for law, figures in LAWS.items():
    change = f"{{time: 0.0, valve: V1, effects: [{{effect: stiction, law: {law}, {figures}}}]}}"
    CASES[law] = ("siso", QUICK, 500, f"[{change}]", 520, ["embedding"])


def run_graph(name: str) -> Graph:
    """Run plant, controller and estimator to the plant's last sample."""
    scenario, schedule, window, changes, samples, _ = CASES[name]
    document = yaml.safe_load(find_config(f"{scenario}.scenario.yaml").read_text())
    values: dict[str, dict[str, Any]] = {
        node: dict(document[node]["ros__parameters"])
        for node in ("plant", "controller", "estimator")
    }
    values["plant"].update(samples=samples, seed=1, valve_changes=changes)
    values["controller"].update(schedule, horizon=30)
    if changes:
        values["controller"].update(
            {key: list(v) if isinstance(v, tuple) else v for key, v in OFTEN.items()}
        )
    values["estimator"].update(schedule, window=window, law=name if name in LAWS else "he")
    if scenario == "siso":
        values["estimator"].update(delay_low=5, delay_high=5)
    graph = Graph()
    graph.listen("recorder")
    nodes = {node: graph.add(node, given) for node, given in values.items()}
    for node in nodes.values():
        node.start()
        assert node.failure == ""
    for part in range(60, samples, 60):
        graph.spin_until(lambda: len(graph.seen["op"]) >= part, f"sample {part}")  # noqa: B023
    graph.spin_until(lambda: nodes["plant"].finished, "the plant's last sample")
    graph.spin_until(lambda: len(graph.seen["prediction"]) == samples, "every prediction")
    for node in nodes.values():
        node.finish()
    graph.spin_some()
    return graph


def run_core(name: str) -> LiveRun:
    """Run the same without ROS."""
    scenario, schedule, window, changes, samples, _ = CASES[name]
    found = Scenario.load(find_config(f"{scenario}.scenario.yaml"))
    estimator = dataclasses.replace(found.estimator, window=window, **schedule)
    if scenario == "siso":
        law = name if name in LAWS else "he"
        estimator = dataclasses.replace(estimator, delay_low=5, delay_high=5, law=law)
    controller = dataclasses.replace(found.controller, horizon=30, **schedule)
    if changes:
        controller = dataclasses.replace(controller, **OFTEN)
    return run_live(
        dataclasses.replace(
            found,
            samples=samples,
            seed=1,
            estimator=estimator,
            controller=controller,
            valve_changes=read_valve_changes(changes, found.plant.valve_names),
        )
    )


@pytest.mark.trial
@pytest.mark.parametrize("name", CASES)
def test_the_graph_does_what_the_core_does_from_estimate_to_swap(name: str) -> None:
    graph, twin = run_graph(name), run_core(name)
    try:
        for topic in ("op", "pv", "stem"):
            assert np.array_equal(by_stamp(graph.seen[topic]), getattr(twin.run.record, topic))
        modes = [change.mode.value for change in twin.changes]
        assert modes == ["unaware", *CASES[name][-1]]
        told_modes = [m.data for m in graph.seen["mode"]]
        assert told_modes[0] == "unaware"
        assert told_modes[-1] == modes[-1]
        check(name, graph, twin)
    finally:
        graph.close()


def by_stamp(messages: list[Any]) -> np.ndarray:
    """Return the values of every stamp, shape (samples, signals), in order.

    A sample in lockstep that is not answered within a second is shown and answered once more.
    """
    told: dict[int, list[float]] = {}
    for message in messages:
        values = list(message.position)
        assert told.setdefault(to_ns(message.header.stamp), values) == values
    return np.array([told[stamp] for stamp in sorted(told)])


def check(name: str, graph: Graph, twin: LiveRun) -> None:
    """Look at what the estimator said last."""
    model = LoopModel.from_yaml(graph.seen["loop_model"][-1].data)
    entry = {str(e["valve"]): e for e in model.provenance}["V1"]
    swap = twin.changes[-1].sample
    start = to_ns(graph.seen["pv"][0].header.stamp)
    step = round(twin.run.record.sample_time * SECOND)
    assert model.document["valid_from"] == start + swap * step
    if name == "tank":
        assert [len(valve.effects) for valve in model.valves] == [1, 0]
        assert "change" not in entry
    elif name in LAWS:
        (friction,) = model.valves[0].effects
        assert friction.law == name
        own = [f"V1.{name}.{entry.key}" for entry in friction.parameters()]
        assert graph.seen["stiction"][-1].name == ["V1.f_s", "V1.f_d", *own]
    elif name == "serviced":
        assert model.valves[0].effects == ()
        assert entry["change"] == "serviced"
        assert 10 <= entry["last_samples"] <= swap - 540
    else:
        (friction,) = model.valves[0].effects
        assert friction.static_friction == pytest.approx(7.5, abs=0.3)  # type: ignore[attr-defined]
        assert entry["change"] == "changed"
        assert entry["f_s_interval"][0] <= 7.5 <= entry["f_s_interval"][1]
