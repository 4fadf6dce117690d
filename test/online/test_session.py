import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from stiction_ros.config_files import config_directories, find_config
from stiction_ros.control import ControlMode
from stiction_ros.errors import InputError
from stiction_ros.identification import VerdictKind
from stiction_ros.identification.problem.models import FEWEST_MOVES
from stiction_ros.loop import LoopModel, ValveChange
from stiction_ros.online.estimator.friction_change import ChangeStatus
from stiction_ros.online.session import Scenario, run_live

SCENARIOS = sorted(
    path
    for path in config_directories()[0].glob("*.scenario.yaml")
    if path.name.partition(".")[0] not in ("neighbours", "cascade")
)


@pytest.fixture(scope="module")
def siso() -> Scenario:
    return Scenario.load(find_config("siso.scenario.yaml"))


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.name)
def test_every_scenario_that_comes_along_is_read(path: Path) -> None:
    scenario = Scenario.load(path)
    assert scenario.name == path.name.split(".")[0]
    assert scenario.controller.fit_first == scenario.estimator.fit_first
    assert scenario.controller.fit_every == scenario.estimator.fit_every
    assert scenario.controller.fit_latency == scenario.estimator.fit_latency
    assert scenario.estimator.window >= scenario.estimator.fit_first or "tank" in scenario.name
    assert np.isfinite(scenario.set_points.repeat)


def quick(siso: Scenario) -> Scenario:
    """Two fits within a run of 620 samples."""
    changes: dict[str, Any] = {"fit_first": 400, "fit_every": 100}
    estimator = dataclasses.replace(
        siso.estimator, window=500, delay_low=5, delay_high=5, **changes
    )
    controller = dataclasses.replace(siso.controller, **changes)
    return dataclasses.replace(siso, estimator=estimator, controller=controller)


@pytest.mark.trial
def test_two_runs_with_one_seed_are_equal_bit_for_bit(siso: Scenario) -> None:
    one, two = (run_live(quick(siso), samples=620) for _ in range(2))
    assert np.array_equal(one.run.record.op, two.run.record.op)
    assert np.array_equal(one.run.record.pv, two.run.record.pv)
    assert np.array_equal(one.stem_estimate, two.stem_estimate)
    assert one.changes == two.changes
    assert [fit.end for fit in one.fits] == [399, 499, 599]


@pytest.mark.trial
def test_a_valve_of_another_law_than_the_embedded_one_is_never_called_healthy(
    siso: Scenario,
) -> None:
    known = LoopModel.load(find_config("example1.loop.yaml"))  # He's law
    law = {"effect": "stiction", "law": "semi_physical", "f_s": 5.0, "f_d": 2.0}
    sticky = known.to_mapping()["valves"][0] | {"effects": [law]}
    changes: dict[str, Any] = {"fit_first": 1000, "fit_every": 500}
    scenario = dataclasses.replace(
        siso,
        plant=LoopModel.from_mapping(known.to_mapping() | {"valves": [sticky]}),
        process=known,
        controller=dataclasses.replace(
            siso.controller, mode=ControlMode.EMBEDDING.value, **changes
        ),
        estimator=dataclasses.replace(
            siso.estimator, window=1000, delay_low=5, delay_high=5, **changes
        ),
    )
    live = run_live(scenario, samples=3000, seed=1)
    found = [update.identification.valves[0] for update in live.fits]
    assert [update.end for update in live.fits] == [999, 1499, 1999, 2499, 2999]
    assert live.changes[0].mode is ControlMode.EMBEDDING
    for valve in found:
        assert valve.evidence["moves"] >= FEWEST_MOVES
        assert valve.verdict is not VerdictKind.HEALTHY
        low, high = valve.static_interval
        assert low <= 5.0 <= high
    assert min(valve.static_friction for valve in found) < 1.0  # which alone says nothing


def test_a_seed_in_place_of_the_scenarios_gives_other_noise(siso: Scenario) -> None:
    one, two = (run_live(siso, samples=60, seed=seed) for seed in (1, 2))
    assert not np.array_equal(one.run.record.pv, two.run.record.pv)


def test_a_swap_takes_effect_the_latency_after_its_window(siso: Scenario) -> None:
    run = run_live(quick(siso), samples=620)
    first = next(fit for fit in run.fits if fit.loop_model is not None)
    assert run.swap is not None
    assert run.swap.sample == first.end + siso.controller.fit_latency
    assert run.swap.mode is ControlMode.EMBEDDING


def test_without_identification_the_controller_stays(siso: Scenario) -> None:
    run = run_live(siso, samples=60, identify=False)
    assert (run.fits, run.swap) == ((), None)


def test_ideal_valves_follow_op(siso: Scenario) -> None:
    run = run_live(siso, samples=60, ideal_valves=True, identify=False)
    assert run.run.record.stem is not None
    assert np.array_equal(run.run.record.stem, run.run.record.op)
    assert np.array_equal(run.stem_estimate, run.run.record.op)


CHANGES = [{"time": 30.0, "valve": "V1", "effects": [{"effect": "backlash", "band": 2.0}]}]


@pytest.mark.parametrize("value", [CHANGES, str(CHANGES)], ids=["list", "text"])
def test_a_valve_changes_in_mid_run(value: Any, tmp_path: Path) -> None:
    path = written(tmp_path, "plant", "valve_changes", value)
    scenario = Scenario.load(path)
    assert isinstance(scenario.nodes["plant"]["valve_changes"], str)  # as a ROS parameter is
    changed = run_live(scenario, samples=90, identify=False).run.record
    as_before = dataclasses.replace(scenario, valve_changes=())
    plain = run_live(as_before, samples=90, identify=False).run.record
    assert changed.stem is not None
    assert plain.stem is not None
    assert np.array_equal(changed.stem[:30], plain.stem[:30])
    assert not np.array_equal(changed.stem[30:], plain.stem[30:])
    assert np.all(np.abs(changed.stem - changed.op)[30:] <= 6.0)


def test_ideal_valves_stay_ideal_whatever_changes(tmp_path: Path) -> None:
    scenario = Scenario.load(written(tmp_path, "plant", "valve_changes", CHANGES))
    record = run_live(scenario, samples=60, ideal_valves=True, identify=False).run.record
    assert record.stem is not None
    assert np.array_equal(record.stem, record.op)


@pytest.mark.trial
def test_a_serviced_valve_is_noticed_and_the_window_begins_anew(siso: Scenario) -> None:
    scenario = quick(siso)
    changes = (ValveChange(540.0, "V1", ()),)
    # A controller that moves often, as its jumps have no price: what is looked at is the window,
    # after few samples.
    controller = dataclasses.replace(
        scenario.controller,
        horizon=30,
        look_ahead=0,
        kick_limits=(math.inf,),
        move_worth=(0.0,),
        embedding_move_weights=(0.01,),
    )
    scenario = dataclasses.replace(scenario, controller=controller, valve_changes=changes)
    live = run_live(scenario, samples=1105, seed=1)
    noticed = next(fit for fit in live.fits if fit.changes and fit.loop_model is not None)
    (change,) = noticed.changes
    assert change.status is ChangeStatus.SERVICED
    assert noticed.trusted == {}
    assert noticed.loop_model is not None
    assert noticed.loop_model.valves[0].effects == ()
    (entry,) = noticed.loop_model.provenance
    assert (entry["change"], entry["last_samples"]) == ("serviced", change.samples)
    assert noticed.end + 1 - change.samples >= 540
    assert live.changes[-1].mode is ControlMode.UNAWARE
    assert live.changes[-1].sample == noticed.end + scenario.controller.fit_latency
    later = [fit for fit in live.fits if fit.end > noticed.end]
    assert later
    for fit in later:  # the window holds nothing from before, and no old friction comes back
        assert fit.identification.samples == fit.end + 1 - (noticed.end + 1 - change.samples)
        assert fit.trusted == {}


def test_a_window_that_cannot_be_used_does_not_end_the_run(siso: Scenario) -> None:
    """A window of ten samples is too short for a fit; the loop must go on."""
    changes: dict[str, Any] = {"fit_first": 10, "fit_every": 40}
    scenario = dataclasses.replace(
        siso,
        estimator=dataclasses.replace(siso.estimator, **changes),
        controller=dataclasses.replace(siso.controller, **changes),
    )
    run = run_live(scenario, samples=30)
    assert len(run.run.record) == 30


def written(tmp_path: Path, node: str, key: str, value: Any) -> Path:
    """The siso scenario with one parameter changed, beside copies of its files."""
    source = find_config("siso.scenario.yaml")
    for name in ("example1.loop.yaml", "example1_process.loop.yaml", "siso.set_points.yaml"):
        (tmp_path / name).write_text((source.parent / name).read_text())
    document = yaml.safe_load(source.read_text())
    document[node]["ros__parameters"][key] = value
    path = tmp_path / "my.scenario.yaml"
    path.write_text(yaml.safe_dump(document))
    return path


WRONG = [
    ("plant", "sampels", 5),
    ("plant", "samples", 0),
    ("plant", "samples", "many"),
    ("plant", "seed", -1),
    ("plant", "model", "none.loop.yaml"),
    ("plant", "set_points", "none.yaml"),
    ("plant", "valve_changes", [{"time": 1.0, "valve": "V9", "effects": []}]),
    ("plant", "valve_changes", "[{time: soon"),
    ("controller", "horizn", 5),
    ("controller", "horizon", 0),
    ("controller", "horizon", 5.5),
    ("controller", "move_weights", [1.0, 1.0]),
    ("controller", "mode", "smart"),
    ("controller", "model", "none.loop.yaml"),
    ("controller", "output_weights", 1.0),
    ("estimator", "windw", 5),
    ("estimator", "window", 1),
    ("estimator", "delay_low", 11),
    ("estimator", "fit_first", float("nan")),
    ("recorder", "directry", "x"),
]


@pytest.mark.parametrize(("node", "key", "value"), WRONG)
def test_a_wrong_scenario_gets_one_line_that_names_the_file(
    node: str, key: str, value: Any, tmp_path: Path
) -> None:
    path = written(tmp_path, node, key, value)
    with pytest.raises(InputError) as caught:
        run_live(Scenario.load(path), samples=2)
    line = str(caught.value)
    assert "\n" not in line
    assert str(tmp_path) in line
    assert key.partition("_")[0] in line or str(value) in line


@pytest.mark.parametrize("key", ["fit_first", "fit_every", "fit_latency"])
def test_two_schedules_of_the_fits_are_refused(key: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"{key}: is 7 for the estimator and .* same value"):
        Scenario.load(written(tmp_path, "estimator", key, 7))


@pytest.mark.parametrize("node", ["plant", "controller", "estimator"])
def test_a_missing_node_is_named(node: str, tmp_path: Path) -> None:
    path = written(tmp_path, "plant", "seed", 1)
    document = yaml.safe_load(path.read_text())
    del document[node]
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(InputError, match=f"lacks '{node}'; add {node}"):
        Scenario.load(path)


@pytest.mark.parametrize(("node", "key"), [("controller", "model"), ("estimator", "monitor_model")])
@pytest.mark.parametrize("file", ["tank.loop.yaml", "slow.loop.yaml"])
def test_a_model_of_another_loop_is_refused(node: str, key: str, file: str, tmp_path: Path) -> None:
    slow = LoopModel.load(find_config("example1.loop.yaml")).to_mapping() | {"sample_time": 2.0}
    (tmp_path / "slow.loop.yaml").write_text(yaml.safe_dump(slow))
    (tmp_path / "tank.loop.yaml").write_text(find_config("tank.loop.yaml").read_text())
    with pytest.raises(InputError, match=f"{node}: {file}: has other valves, .* use V1, PV1, 1 s"):
        Scenario.load(written(tmp_path, node, key, file))


def test_a_scenario_finds_its_files_beside_itself(tmp_path: Path) -> None:
    path = written(tmp_path, "plant", "seed", 77)
    assert Scenario.load(path).seed == 77


def test_a_missing_scenario_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        Scenario.load(tmp_path / "none.scenario.yaml")
