import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from stiction_ros.config_files import find_config
from stiction_ros.control import ControlMode
from stiction_ros.errors import InputError
from stiction_ros.online.session import Scenario, run_live
from stiction_ros.online.unit import UnitScenario, load_scenario, run_unit

UNITS = ("neighbours", "cascade")


def unit(name: str) -> UnitScenario:
    return UnitScenario.load(find_config(f"{name}.scenario.yaml"))


@pytest.mark.parametrize("name", UNITS)
def test_a_scenario_of_several_loops_is_told_from_one_of_one_loop(name: str) -> None:
    path = find_config(f"{name}.scenario.yaml")
    assert isinstance(load_scenario(path), UnitScenario)
    assert isinstance(load_scenario(find_config("siso.scenario.yaml")), Scenario)
    with pytest.raises(InputError, match="holds several loops"):
        Scenario.load(path)


@pytest.mark.parametrize("name", UNITS)
def test_every_loop_has_nodes_and_settings_of_its_own(name: str) -> None:
    scenario = unit(name)
    for loop in scenario.loops:
        member = scenario.members[loop.name]
        assert (member.process.valve_names, member.process.outputs) == (loop.valves, loop.outputs)
        assert scenario.nodes[f"{loop.name}/estimator"]["loop"] == loop.name
        assert member.controller.fit_first == member.estimator.fit_first


def test_a_controller_of_other_tags_is_refused(tmp_path: Path) -> None:
    for file in find_config("cascade.scenario.yaml").parent.glob("cascade*"):
        shutil.copy(file, tmp_path)
    path = tmp_path / "cascade.scenario.yaml"
    nodes = yaml.safe_load(path.read_text(encoding="utf-8"))
    nodes["LC1"]["controller"]["ros__parameters"]["model"] = "cascade_FC1.loop.yaml"
    path.write_text(yaml.safe_dump(nodes), encoding="utf-8")
    with pytest.raises(InputError, match="has other tags than LC1"):
        UnitScenario.load(path)


def test_the_outer_loop_moves_the_set_point_of_the_inner_one() -> None:
    runs = run_unit(unit("cascade"), samples=120, seed=3)
    outer, inner = runs["LC1"].run.record, runs["FC1"].run.record
    assert inner.sp is not None
    assert np.array_equal(inner.sp[1:], outer.op[:-1])
    assert np.ptp(inner.sp) > 0.0
    assert outer.stem is None
    assert inner.stem is not None


def test_two_runs_with_one_seed_are_equal_bit_for_bit() -> None:
    one, two = (run_unit(unit("neighbours"), samples=60, seed=3) for _ in range(2))
    for name, live in one.items():
        assert np.array_equal(live.run.record.op, two[name].run.record.op)
        assert np.array_equal(live.run.record.pv, two[name].run.record.pv)


def test_a_loop_alone_on_its_plant_is_the_loop_that_it_is_by_itself() -> None:
    """What the plant of several loops adds is nothing where there is one."""
    scenario = unit("cascade")
    model = scenario.members["FC1"].plant
    member = scenario.members["FC1"]
    alone = UnitScenario(
        "alone",
        scenario.path,
        {},
        type(scenario.simulated)(model, member.set_points, 1, 100, ()),
        (scenario.loops[1],),
        {"FC1": member},
    )
    found = run_unit(alone, samples=100, seed=2)["FC1"]
    assert np.array_equal(found.run.record.op, run_live(member, samples=100, seed=2).run.record.op)


@pytest.mark.trial
def test_the_valve_at_fault_alone_is_compensated_and_all_loops_come_to_rest() -> None:
    runs = run_unit(unit("cascade"), seed=1)
    assert runs["FC1"].swap is not None
    assert not any(fit.trusted for fit in runs["LC1"].fits)
    assert {change.mode for change in runs["LC1"].changes} == {ControlMode.UNAWARE}
    swap = runs["FC1"].swap.sample
    for live in runs.values():
        error = live.run.record.pv - live.run.record.sp
        assert error[-1000:].std() < 0.75 * error[swap - 1000 : swap].std()
