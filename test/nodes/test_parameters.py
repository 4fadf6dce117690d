"""Every parameter of every node: taken and in force, or refused with the reason."""

import dataclasses
import enum
import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graph import KINDS, Graph
from rclpy.parameter import Parameter

from stiction_ros.nodes.shared.managed import ManagedNode
from stiction_ros.nodes.shared.messages import joint_state
from stiction_ros.settings import Setting, settings_of

SAMPLES = Path(__file__).parents[2] / "bags"
PAST = ("changes", "_proven")  # what was in force before


class NoWorker:
    """Stands for the process that fits, which takes seconds until it is ready."""

    compiled = True

    def __init__(self, methods: Sequence[str]) -> None:
        self.methods = methods

    def close(self) -> None:
        pass


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> Iterator[Graph]:
    monkeypatch.setattr("stiction_ros.nodes.estimator.FitWorker", NoWorker)
    found = Graph()
    yield found
    found.close()


def given(kind: str, directory: Path) -> dict[str, Any]:
    """Parameters with which each node starts alone."""
    loop = {"model": "example1.loop.yaml", "set_points": "siso.set_points.yaml", "speed": 1e-3}
    return {
        "plant": loop,
        "controller": {"model": "tank_linear.loop.yaml", "horizon": 10},
        "estimator": {},
        "recorder": {"directory": str(directory / "bag")},
        "player": {"bag": str(SAMPLES / "sticky_siso"), "paused": True},
        "opcua": {},
    }[kind]


def another(entry: Setting, now: Any) -> Any:
    """Return another value that a setting accepts."""
    if entry.kind == "bool":
        return not now
    if entry.choices:
        return next(choice for choice in entry.choices if choice != now)
    if entry.kind in ("str", "strings"):
        return "other" if entry.kind == "str" else ["other"]
    value = now[0] if entry.kind == "floats" else now
    if entry.kind == "int":
        return value + 1
    if math.isinf(value):
        value = math.copysign(99.0, value)
    moved = min(1.1 * value + 0.01, 0.5 * (value + min(entry.high, 1e9)))
    return [moved] if entry.kind == "floats" else moved


def in_force(value: Any, path: str = "", seen: frozenset[int] = frozenset()) -> dict[str, Any]:
    """Return all plain values that ``value`` holds, by where they stand."""
    if id(value) in seen:
        return {}
    seen |= {id(value)}
    if value is None or isinstance(value, (bool, int, float, str, enum.Enum)):
        return {path: repr(value)}
    if isinstance(value, np.ndarray):
        return {path: value.tolist()}
    if isinstance(value, Mapping):
        parts = value.items()
    elif isinstance(value, deque):
        parts = [("maxlen", value.maxlen)]  # signals of the past may have begun anew
    elif isinstance(value, (tuple, list)):
        parts = enumerate(value)
    elif type(value).__module__.startswith("stiction_ros"):
        parts = vars(value).items() if hasattr(value, "__dict__") else ()
        if not parts and dataclasses.is_dataclass(value):
            parts = ((f.name, getattr(value, f.name)) for f in dataclasses.fields(value))
    else:
        return {}
    found: dict[str, Any] = {}
    for key, part in parts:
        if key not in PAST:
            found |= in_force(part, f"{path}.{key}", seen)
    return found


def core(node: ManagedNode) -> dict[str, Any]:
    """Return what is in force in all that a node keeps below it."""
    parts = {k: v for k, v in vars(node).items() if type(v).__module__.startswith("stiction_ros")}
    return in_force({k: v for k, v in parts.items() if "nodes" not in type(v).__module__})


def built(graph: Graph, kind: str, values: Mapping[str, Any]) -> Any:
    """Build a node that has all it works with; the bridge would need a control system."""
    node = graph.add(kind, values)
    if kind == "opcua":
        node._configured = True
    else:
        node.start()
        graph.spin_until(lambda: node.running, f"{kind} to run")
    if kind == "estimator":
        node._take("pv", joint_state(10**9, ["PV1"], [0.0]))
        node._take("op", joint_state(10**9, ["V1"], [0.0]))
    assert not node.failure
    return node


def work(node: Any) -> dict[str, Any]:
    """Return what is in force in a node after one more step."""
    if node.get_name() == "controller":  # takes what was set between two samples
        node.live.step(node.model.pv0, node.model.pv0)
    return core(node)


def ask(node: Any, name: str, value: Any) -> Any:
    """Set one parameter, as the service does."""
    return node.set_parameters_atomically([Parameter(name, value=value)])


@pytest.mark.parametrize("pace", ["lockstep", "realtime"])
@pytest.mark.parametrize("kind", list(KINDS))
def test_each_parameter_takes_effect_or_is_refused_with_the_reason(
    kind: str, pace: str, graph: Graph, tmp_path: Path
) -> None:
    """What was set while a node runs is in force as in a node that began with it."""
    begin = given(kind, tmp_path / "first")
    entries = settings_of(graph.add(kind).settings_class)
    if any(entry.name == "pace" for entry in entries):
        begin["pace"] = pace
    node = built(graph, kind, begin)
    taken = {}
    for entry in entries:
        before = node.get_parameter(entry.name).value
        value = another(entry, getattr(node.settings, entry.name))
        answer = ask(node, entry.name, value)
        idle = entry.beside[0] == "pace" and entry.beside[1] != pace
        if entry.once or entry.fixed or idle:
            why = "process starts" if entry.once else "lifecycle" if entry.fixed else "no effect"
            assert not answer.successful
            assert f"/{kind}: {entry.name}: " in answer.reason
            assert why in answer.reason
            assert node.get_parameter(entry.name).value == before
        else:
            assert answer.successful, answer.reason
            taken[entry.name] = value
    if not taken or (kind, pace) == ("controller", "realtime"):  # is prepared beside the loop
        return
    fresh = [built(graph, kind, begin | taken) for _ in range(2)]
    found, wanted, again = work(node), work(fresh[0]), work(fresh[1])
    stale = {
        path: (found.get(path), value)
        for path, value in wanted.items()
        if value == again.get(path) and value != found.get(path)
    }
    assert not stale


@pytest.mark.parametrize("kind", list(KINDS))
def test_at_rest_a_node_takes_all_that_it_reads_when_it_is_configured(
    kind: str, graph: Graph
) -> None:
    node = graph.add(kind)
    for entry in settings_of(node.settings_class):
        answer = ask(node, entry.name, another(entry, entry.default))
        assert answer.successful != entry.once, answer.reason


@pytest.mark.parametrize("kind", list(KINDS))
def test_an_unknown_parameter_is_named_beside_those_that_are_known(kind: str, graph: Graph) -> None:
    node = graph.add(kind)
    answer = ask(node, "wnidow", 3)
    assert not answer.successful
    assert answer.reason.startswith(f"{kind}: unknown parameter 'wnidow'; known: ")
    assert all(entry.name in answer.reason for entry in settings_of(node.settings_class))


def test_after_clean_up_another_value_is_in_force(graph: Graph, tmp_path: Path) -> None:
    node = built(graph, "plant", given("plant", tmp_path))
    node.trigger_deactivate()
    assert not ask(node, "seed", 7).successful
    node.trigger_cleanup()
    assert ask(node, "seed", 7).successful
    node.start()
    assert (node.failure, node.settings.seed) == ("", 7)
