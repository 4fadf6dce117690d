"""The launch file against the table of nodes that the demo starts; launch itself is not needed."""

import runpy
import sys
import types
from pathlib import Path
from typing import Any

import pytest
import yaml

from stiction_ros.cli.shared.scenarios import SCENARIOS, STARTED, bridged_nodes, find, loop_nodes
from stiction_ros.errors import InputError
from stiction_ros.nodes.__main__ import NODES

LAUNCH = Path(__file__).resolve().parents[2] / "launch" / "stiction.launch.py"


class Action:
    """Stands for whatever the launch file builds: keeps what it was given."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.given, self.named = given, named


class Configuration(Action):
    def perform(self, context: dict[str, str]) -> str:
        return context[self.given[0]]


@pytest.fixture
def launch(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The launch file's names, and the classes that it was run with."""
    made = {
        "launch": ("LaunchContext", "LaunchDescription", "LaunchDescriptionEntity"),
        "launch.actions": ("DeclareLaunchArgument", "OpaqueFunction"),
        "launch.substitutions": ("LaunchConfiguration",),
        "launch_ros": (),
        "launch_ros.actions": ("Node",),
    }
    for module, names in made.items():
        stub = types.ModuleType(module)
        for name in names:
            base = Configuration if name == "LaunchConfiguration" else Action
            setattr(stub, name, type(name, (base,), {}))
        monkeypatch.setitem(sys.modules, module, stub)
    return runpy.run_path(str(LAUNCH))


def start(launch: Any, **given: str) -> list[Any]:
    """Return the nodes that the file starts with these arguments."""
    entities = launch["generate_launch_description"]().given[0]
    declared = [e for e in entities if type(e).__name__ == "DeclareLaunchArgument"]
    context = {e.given[0]: e.named["default_value"] for e in declared}
    assert given.keys() <= context.keys()
    (opaque,) = [e for e in entities if type(e).__name__ == "OpaqueFunction"]
    return list(opaque.named["function"](context | given))


@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize(("speed", "seed"), [("max", ""), ("25.0", "7")])
def test_it_starts_what_the_demo_starts(
    launch: Any, scenario: str, speed: str, seed: str, tmp_path: Path
) -> None:
    nodes = start(launch, scenario=scenario, directory=str(tmp_path), speed=speed, seed=seed)
    wanted = loop_nodes(
        find(scenario),
        tmp_path,
        seed=int(seed) if seed else None,
        speed=None if speed == "max" else float(speed),
    )
    assert [n.named["name"] for n in nodes] == list(wanted) == list(STARTED)
    for node in nodes:
        name = node.named["name"]
        assert node.named["package"] == "stiction_ros"
        assert node.named["executable"] == name
        (path,) = node.named["parameters"]
        document = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
        assert document[f"/**/{name}"]["ros__parameters"] == wanted[name]


@pytest.mark.parametrize("namespace", ["", "unit1"])
def test_the_parameters_reach_nodes_in_any_namespace(
    launch: Any, namespace: str, tmp_path: Path
) -> None:
    nodes = start(launch, directory=str(tmp_path), namespace=namespace)
    for node in nodes:
        assert node.named["namespace"] == namespace
        (path,) = node.named["parameters"]
        assert f"/**/{node.named['name']}" in yaml.safe_load(Path(path).read_text())


def test_a_bridge_stands_in_the_place_of_the_plant(launch: Any, tmp_path: Path) -> None:
    told = tmp_path / "plant.yaml"
    nodes = start(
        launch, scenario="tank", directory=str(tmp_path), opcua=str(told), namespace="FIC101"
    )
    wanted = bridged_nodes(find("tank"), tmp_path, "topic:pv")
    assert [n.named["name"] for n in nodes] == [*wanted, "opcua"]
    assert "plant" not in wanted
    bridge = nodes.pop().named
    assert (bridge["executable"], bridge["namespace"]) == ("opcua", "")
    assert bridge["parameters"] == [str(told)]
    for node in nodes:
        assert node.named["namespace"] == "FIC101"
        (path,) = node.named["parameters"]
        values = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
        found = values[f"/**/{node.named['name']}"]["ros__parameters"]
        assert found == wanted[node.named["name"]]
        assert "plant" not in found.get("wait_for", [])
    assert wanted["controller"]["pace"] == wanted["estimator"]["pace"] == "realtime"
    assert wanted["controller"]["speed"] == 1.0


def test_a_scenario_of_a_real_loop_needs_no_plant(tmp_path: Path) -> None:
    nodes = yaml.safe_load(find("siso").read_text(encoding="utf-8"))
    del nodes["plant"]
    nodes["controller"]["ros__parameters"]["model"] = "own.loop.yaml"
    own = tmp_path / "own.scenario.yaml"
    own.write_text(yaml.safe_dump(nodes), encoding="utf-8")
    found = bridged_nodes(own, tmp_path / "run", "topic:pv")
    assert list(found) == ["recorder", "estimator", "controller"]
    assert found["controller"]["model"] == str((tmp_path / "own.loop.yaml").resolve())
    nodes["controller"]["ros__parameters"]["modle"] = "x"
    own.write_text(yaml.safe_dump(nodes), encoding="utf-8")
    with pytest.raises(InputError, match="modle"):
        bridged_nodes(own, tmp_path / "run", "topic:pv")


def test_every_executable_is_a_node() -> None:
    assert {*STARTED, "opcua"} <= set(NODES)
