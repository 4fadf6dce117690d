"""The demonstration of the bridge: its parts always, the whole of it where there is time."""

import json
import os
import stat
from pathlib import Path

import pytest
import yaml

from stiction_ros.cli.main import main
from stiction_ros.cli.shared.scenarios import SCENARIOS
from stiction_ros.opcua.plant_link import OpcuaNodeSettings
from stiction_ros.opcua.tag_map import TagMap
from stiction_ros.settings import from_mapping
from stiction_studies.commands import demo_opcua
from stiction_studies.commands.demo_opcua import _nodes, _plant


def test_a_bare_demo_does_not_run_it() -> None:
    assert demo_opcua.NAME not in SCENARIOS


def test_its_files_bridge_the_tank_and_keep_their_secrets(tmp_path: Path) -> None:
    plant = _plant(tmp_path, 1, 600.0)
    (loop,) = TagMap.load(plant.map_file).loops
    assert (loop.loop, loop.sample_time) == ("tank", 60.0)
    assert loop.grant is not None
    assert loop.grant.watchdog == demo_opcua.WATCHDOG
    secrets = tmp_path / "secrets"
    for path in (*secrets.glob("*.pem"), *secrets.glob("*.password")):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600, path
    words = [path.read_text() for path in secrets.glob("*.password")]
    assert len(set(words)) == len(demo_opcua.USERS)
    told = yaml.safe_dump(_nodes(tmp_path, plant))
    assert not any(word in told for word in words)
    for user in demo_opcua.USERS:
        plant.credentials(user).check(writes=True)


def test_its_nodes_wait_for_one_another_and_know_their_parameters(tmp_path: Path) -> None:
    nodes = _nodes(tmp_path, _plant(tmp_path, 1, 600.0))
    assert set(nodes) == {"controller", "estimator", "recorder", "opcua"}
    settings = from_mapping(OpcuaNodeSettings, nodes["opcua"], "opcua")
    assert settings.write == ("tank",)
    assert {nodes[name]["pace"] for name in ("controller", "estimator")} == {"realtime"}
    for name in ("controller", "estimator", "opcua"):
        assert set(nodes[name]["wait_for"]) == set(nodes) - {name}


@pytest.mark.skipif(
    os.environ.get("STICTION_ALL_TRIALS") != "1", reason="four minutes: STICTION_ALL_TRIALS=1"
)
def test_granted_cycle_gone_taken_back(tmp_path: Path) -> None:
    assert main(["demo", "opcua", "--out", str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "opcua" / "summary.json").read_text())
    assert [one["to"] for one in summary["transfers"]] == ["remote", "plant"]
    assert max(one["step"] for one in summary["transfers"]) <= 1.0
    for topic, count in summary["messages"].items():
        lost = (count["published"] or 0) - count["recorded"] - (topic == "/diagnostics")
        assert lost <= 0, topic
    assert (tmp_path / "opcua" / "report.html").stat().st_size > 10_000
