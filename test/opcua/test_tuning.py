from pathlib import Path

import numpy as np
import pytest
import yaml
from tuning_trial import CASES, TUNING, scenario_of_the_page, tried

from stiction_ros.cli.main import main
from stiction_ros.cli.shared.scenarios import bridged_nodes, write_parameters
from stiction_ros.config_files import find_config
from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.session import read_nodes


@pytest.mark.trial
def test_the_tuning_of_the_page_moves_the_valve_for_a_reason_only(tmp_path: Path) -> None:
    found = {name: tried(tmp_path, *case) for name, case in CASES.items()}
    unaware, inversion, bare, full = found.values()
    assert max(bare.moves, full.moves) < 0.6 * min(unaware.moves, inversion.moves)
    assert full.travel < min(unaware.travel, bare.travel)
    assert bare.error < full.error < 0.6 * min(unaware.error, inversion.error)


def test_the_file_of_the_page_serves_the_launch_file_and_a_start_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "fic101.scenario.yaml"
    path.write_text(scenario_of_the_page(), encoding="utf-8")
    for node in ("controller", "estimator"):
        assert read_nodes(path, without="plant")[node]["pace"] == "realtime"
    (tmp_path / "fic101.loop.yaml").write_text(find_config("flow.loop.yaml").read_text())
    nodes = bridged_nodes(path, tmp_path, "topic:pv")
    assert {key: nodes["controller"][key] for key in TUNING} == {"move_worth": [0.01]}
    write_parameters(nodes, tmp_path / "p.yaml")
    again = yaml.safe_load((tmp_path / "p.yaml").read_text())
    assert set(again) == {"/**/recorder", "/**/estimator", "/**/controller"}


def test_a_node_is_named_once(tmp_path: Path) -> None:
    path = tmp_path / "twice.scenario.yaml"
    path.write_text(scenario_of_the_page() + "controller:\n  ros__parameters: {mode: hold}\n")
    with pytest.raises(InputError, match="controller"):
        read_nodes(path, without="plant")


@pytest.mark.trial
def test_the_command_of_the_page_finds_the_process_behind_a_sticky_valve(tmp_path: Path) -> None:
    """Delay 2, gain 0.8, f_S 4, f_D 1.5, by the record of a loop that cycles."""
    record, out = str(tmp_path / "FIC101.csv"), str(tmp_path / "fic101.loop.yaml")
    loop = str(find_config("flow.loop.yaml"))
    assert main(["simulate", loop, "--samples", "1500", "--out", record]) == 0
    assert main(["identify", record, "--model", out]) == 0
    model = LoopModel.load(Path(out))
    linear = model.process.linear(model.sample_time)
    gain = linear.c @ np.linalg.solve(np.eye(linear.order) - linear.a, linear.b)
    assert gain[0, 0] == pytest.approx(0.8, rel=0.05)
    assert yaml.safe_load(Path(out).read_text())["process"]["outputs"][0]["delay"] == {"V1": 2}
    (friction,) = model.valves[0].effects
    assert isinstance(friction, HeStiction)
    assert friction.static_friction == pytest.approx(4.0, abs=0.2)
    assert friction.dynamic_friction == pytest.approx(1.5, abs=0.2)
