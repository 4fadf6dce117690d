from typing import Any

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.effects import HeStiction
from stiction_ros.loop import LoopModel, Plant


def loop(**extra: Any) -> LoopModel:
    """Two valves with limits, one output per valve, noise in either place."""

    def output(name: str, valve: str, noise: dict[str, Any]) -> dict[str, Any]:
        return {"name": name, "a": [-0.8], "b": {valve: [0.2]}, "noise": noise}

    return LoopModel.from_mapping(
        {
            "loop": "two",
            "sample_time": 2.0,
            "valves": [
                {"name": "V1", "limits": [0.0, 100.0], "effects": []},
                {"name": "V2", "limits": [20.0, 60.0], "effects": []},
            ],
            "process": {
                "kind": "arx",
                "outputs": [
                    output("Y1", "V1", {"std": 0.1}),
                    output("Y2", "V2", {"std": 0.1, "enters": "equation"}),
                ],
            },
            "initial": {"stem": {"V1": 50.0, "V2": 50.0}, "pv": {"Y1": 50.0, "Y2": 50.0}},
        }
        | extra
    )


def drive(plant: Plant, ops: np.ndarray) -> dict[str, np.ndarray]:
    seen: dict[str, list[np.ndarray]] = {"pv": [], "clean": [], "stem": [], "dv": []}
    for op in ops:
        measured = plant.measure()
        seen["pv"].append(measured.pv)
        seen["clean"].append(measured.pv_clean)
        seen["dv"].append(measured.dv)
        seen["stem"].append(plant.apply(op))
    return {key: np.array(values) for key, values in seen.items()}


OPS = np.random.default_rng(7).uniform(-20.0, 120.0, (60, 2))


@pytest.mark.parametrize("name", ["example1.loop.yaml", "tank.loop.yaml", "tank_linear.loop.yaml"])
def test_the_same_seed_gives_the_same_numbers(name: str) -> None:
    model = LoopModel.load(find_config(name))
    ops = OPS[:, : len(model.valves)]
    one, two = (drive(Plant(model, 3), ops) for _ in range(2))
    assert all(np.array_equal(one[key], two[key]) for key in one)


def test_another_seed_gives_other_noise() -> None:
    one, two = (drive(Plant(loop(), seed), OPS) for seed in (3, 4))
    assert not np.any(one["pv"][1:] == two["pv"][1:])


def test_measurement_noise_does_not_depend_on_what_is_applied() -> None:
    runs = [drive(Plant(loop(), 3), ops) for ops in (OPS, np.full_like(OPS, 50.0))]
    noise = [run["pv"][:, 0] - run["clean"][:, 0] for run in runs]
    assert noise[0] == pytest.approx(noise[1], abs=1e-12)


def test_equation_noise_does_not_depend_on_what_is_applied() -> None:
    runs = [drive(Plant(loop(), 3), ops) for ops in (OPS, np.full_like(OPS, 50.0))]
    v = []
    for run in runs:
        y = run["pv"][:, 1]
        v.append(y[1:] - 0.8 * y[:-1] - 0.2 * run["stem"][:-1, 1])
    assert v[0] == pytest.approx(v[1], abs=1e-12)
    assert np.std(v[0]) == pytest.approx(0.1, rel=0.3)


def test_friction_does_not_change_the_noise() -> None:
    sticky = loop().with_valve_effects({"V1": [HeStiction(8.0, 1.0)]})
    runs = [drive(Plant(model, 3), OPS) for model in (loop(), sticky)]
    noise = [run["pv"] - run["clean"] for run in runs]
    assert noise[0] == pytest.approx(noise[1], abs=1e-12)


def test_stems_stay_within_the_limits() -> None:
    stems = drive(Plant(loop(), 1), OPS)["stem"]
    assert (stems[:, 0].min(), stems[:, 0].max()) == (0.0, 100.0)
    assert (stems[:, 1].min(), stems[:, 1].max()) == (20.0, 60.0)


def test_a_sticky_valve_sees_the_limited_op() -> None:
    # Beyond the limit the error would exceed f_S; within it the valve stays.
    sticky = loop().with_valve_effects({"V2": [HeStiction(11.0, 1.0)]})
    assert Plant(sticky, 1).apply(np.array([50.0, 90.0]))[1] == 50.0


def test_effects_act_in_signal_order() -> None:
    effects = [HeStiction(5.0, 0.0), HeStiction(3.0, 0.0)]
    model = loop().with_valve_effects({"V1": effects})
    ops, start = OPS[:, 0].clip(0.0, 100.0), 50.0
    expected = effects[1].simulate(effects[0].simulate(ops, start), start)
    assert np.array_equal(drive(Plant(model, 1), OPS)["stem"][:, 0], expected)


def test_measuring_twice_changes_nothing() -> None:
    plant = Plant(loop(), 1)
    assert plant.measure() is plant.measure()


def test_time_counts_in_sample_times() -> None:
    plant = Plant(loop(), 1)
    times = []
    for op in OPS[:3]:
        times.append(plant.measure().time)
        plant.apply(op)
    assert times == [0.0, 2.0, 4.0]


def test_it_starts_at_rest_at_the_initial_point() -> None:
    run = drive(Plant(loop(), 1), np.full((20, 2), 50.0))
    assert run["clean"][:, 0] == pytest.approx(50.0)


def test_a_disturbance_adds_to_its_output_only() -> None:
    upset = loop(disturbances=[{"output": "Y1", "effect": "step", "time": 6.0, "size": 3.0}])
    quiet, run = drive(Plant(loop(), 1), OPS), drive(Plant(upset, 1), OPS)
    added = run["clean"] - quiet["clean"]
    expected = np.where(2.0 * np.arange(60) >= 6.0, 3.0, 0.0)
    assert added[:, 0] == pytest.approx(expected, abs=1e-12)
    assert not added[:, 1].any()


def test_disturbances_of_one_output_add_up() -> None:
    both = [{"output": "Y1", "effect": "drift", "rate": r} for r in (0.5, 0.25)]
    quiet, run = drive(Plant(loop(), 1), OPS), drive(Plant(loop(disturbances=both), 1), OPS)
    assert (run["clean"] - quiet["clean"])[:, 0] == pytest.approx(1.5 * np.arange(60), abs=1e-9)


def test_a_sensor_effect_comes_after_the_noise_and_spares_the_process() -> None:
    drifting = loop(sensors=[{"name": "Y2", "effects": [{"effect": "drift", "rate": 0.5}]}])
    quiet, run = drive(Plant(loop(), 1), OPS), drive(Plant(drifting, 1), OPS)
    assert np.array_equal(run["clean"], quiet["clean"])
    assert (run["pv"] - quiet["pv"])[:, 1] == pytest.approx(np.arange(60.0), abs=1e-9)
    assert not (run["pv"] - quiet["pv"])[:, 0].any()


def test_a_sensor_with_memory_rests_at_its_initial_value() -> None:
    stuck = {"effect": "lag", "tau": 1e9}
    run = drive(
        Plant(loop(sensors=[{"name": "Y1", "effects": [stuck]}]), 1), np.full((20, 2), 50.0)
    )
    assert run["pv"][:, 0] == pytest.approx(50.0, abs=1e-5)


@pytest.mark.parametrize("measured", [[], ["F_B"]])
def test_a_disturbance_of_an_input_reaches_the_tank_and_dv(measured: list[str]) -> None:
    document = {
        "loop": "tank",
        "sample_time": 60.0,
        "valves": [{"name": "V1"}, {"name": "V2"}],
        "process": {"kind": "stirred_tank", "measured_disturbances": measured},
        "disturbances": [{"input": "F_B", "effect": "step", "time": 120.0, "size": 0.1}],
    }
    run = drive(Plant(LoopModel.from_mapping(document), 1), np.full((8, 2), 50.0))
    assert run["clean"][:3] == pytest.approx(np.tile([7.5, 42.324], (3, 1)), abs=1e-3)
    assert run["clean"][3, 0] < 7.5 - 0.01
    assert run["dv"].tolist() == [[0.1 if k >= 2 else 0.0] * len(measured) for k in range(8)]
