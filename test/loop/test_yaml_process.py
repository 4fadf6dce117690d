"""Loop models from linear systems."""

import types
from typing import Any

import numpy as np
import pytest
import scipy.signal as scipy_signal
import yaml

from stiction_ros import InputError, LoopModel, find_config, simulate

TIME = np.arange(60.0)
LAG = scipy_signal.TransferFunction([0.8], [8.0, 1.0])


def step(model: LoopModel, output: int = 0, valve: int = 0) -> np.ndarray:
    responses = model.process.linear(model.sample_time).step_responses(len(TIME))
    return np.asarray(responses[:, output, valve])


def of_control(dt: Any = 0, **parts: Any) -> Any:
    """Return what python-control's systems have."""
    return types.SimpleNamespace(dt=dt, **parts)


@pytest.mark.parametrize(
    "system",
    [
        LAG,
        LAG.to_ss(),
        ([0.8], [8.0, 1.0]),
        (np.array([0.8]), np.array([8, 1])),
        (-1.0 / 8.0, 0.1, 1.0, 0.0),
        of_control(num=[[np.array([0.8])]], den=[[np.array([8, 1])]]),
        of_control(A=[[-0.125]], B=[[0.1]], C=[[1.0]], D=[[0.0]]),
    ],
)
@pytest.mark.parametrize("dead_time", [0.0, 2.0])
def test_continuous_systems_are_sampled(system: Any, dead_time: float) -> None:
    model = LoopModel.from_system(system, 1.0, dead_time=dead_time)
    wanted = -0.8 * np.expm1(-np.maximum(TIME - dead_time, 0.0) / 8.0)
    assert step(model) == pytest.approx(wanted)
    assert (model.valve_names, model.outputs, model.name) == (("V1",), ("PV1",), "loop")
    assert np.array_equal(step(LoopModel.from_yaml(model.to_yaml())), step(model))


@pytest.mark.parametrize("dt", [2.0, True])
def test_a_discrete_state_space_is_taken_as_it_is(dt: Any) -> None:
    system = of_control(dt, A=0.9, B=0.1, C=1.0, D=0.0)
    model = LoopModel.from_system(system, 2.0, dead_time=6.0)
    assert model.sample_time == 2.0
    assert step(model) == pytest.approx(1.0 - 0.9 ** np.maximum(TIME - 3.0, 0.0))


def test_a_dead_time_between_samples_is_kept() -> None:
    model = LoopModel.from_system(LAG, 1.0, dead_time=2.3)
    assert step(model) == pytest.approx(-0.8 * np.expm1(-np.maximum(TIME - 2.3, 0.0) / 8.0))


def test_state_space_may_have_several_inputs_and_outputs() -> None:
    system = of_control(
        A=np.diag([-0.2, -0.1]), B=np.eye(2), C=[[1, 1], [0, 2]], D=np.zeros((2, 2))
    )
    model = LoopModel.from_system(system, 1.0, name="x")
    assert (model.valve_names, model.outputs, model.name) == (("V1", "V2"), ("PV1", "PV2"), "x")
    assert step(model, 1, 1) == pytest.approx(-20.0 * np.expm1(-0.1 * TIME))


def test_transfer_functions_of_several_valves_are_written_in_yaml() -> None:
    model = LoopModel.from_yaml(
        "{loop: x, sample_time: 1.0, valves: [{name: a, effects: []}, {name: b, effects: []}], "
        "process: {kind: transfer_function, outputs: [{name: T, num: {a: [2.0], b: [1.0]}, "
        "den: {a: [5.0, 1.0], b: [8.0, 6.0, 1.0]}, dead_time: {b: 1.5}, noise: {std: 0.1}, "
        "range: [0.0, 9.0]}]}}"
    )
    assert step(model) == pytest.approx(-2.0 * np.expm1(-TIME / 5.0))
    slow, fast = (-np.expm1(-np.maximum(TIME - 1.5, 0.0) / lag) for lag in (4.0, 2.0))
    assert step(model, 0, 1) == pytest.approx(2.0 * slow - fast)
    assert (model.process.noise[0].std, model.instruments[0].high) == (0.1, 9.0)


def test_further_sections_make_a_loop_that_runs() -> None:
    tuning = {"kind": "pi", "gain": 1.0, "integral_time": 8.0}
    point = {"op": {"V1": 40.0}, "pv": {"PV1": 7.0}}
    loop = LoopModel.from_system(LAG, 1.0, controller=tuning, operating_point=point)
    record = simulate(loop, samples=50)
    assert (record.op[0, 0], record.pv[0, 0]) == (40.0, 7.0)


def test_a_delay_in_state_space_is_that_of_arx() -> None:
    arx = LoopModel.load(find_config("flow.loop.yaml"))
    document = arx.to_mapping()
    document["process"] = yaml.safe_load(
        "{kind: state_space, a: [[0.8825]], b: [[0.094]], c: [[1.0]], delay: {V1: 2}, "
        "outputs: [{name: PV1, noise: {std: 0.05}}]}"
    )
    found = LoopModel.from_mapping(document)
    assert step(found) == pytest.approx(step(arx))
    assert simulate(found, samples=200).pv == pytest.approx(simulate(arx, samples=200).pv)
    tank = LoopModel.load(find_config("tank_linear.loop.yaml")).to_mapping()
    late = LoopModel.from_mapping(tank | {"process": tank["process"] | {"delay": {"V2": 3}}})
    plain = LoopModel.from_mapping(tank)
    assert step(late, 1, 0) == pytest.approx(step(plain, 1, 0))
    assert step(late, 1, 1)[3:] == pytest.approx(step(plain, 1, 1)[:-3])


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (([1.0, 1.0], [8.0, 1.0]), "outputs.0..V1: PV answers at once"),
        ((-1.0, 1.0, 1.0, 1.0), "system: PV answers at once: D is not 0"),
        ("flow", "system: str is no linear system; give a system of scipy.signal or control"),
        (np.eye(2), "system: ndarray is no linear system"),
        ((["a"], [1.0, 2.0]), "system: cannot be read"),
        ((np.eye(2), np.ones((3, 1)), np.ones((1, 2)), 0.0), "system: cannot be read"),
        (
            ([[[1.0]], [[2.0]]], [[[5.0, 1.0]], [[6.0, 1.0]]]),
            "system: several transfer functions cannot be taken",
        ),
        (
            of_control(1.0, num=[0.1], den=[1.0, -0.9]),
            "system: a discrete .* cannot be taken; .* kind: arx",
        ),
        (of_control(2.0, A=0.9, B=0.1, C=1.0, D=0.0), "sample_time: the system has 2 s, not 1 s"),
        (of_control(1.0, A=0.9, B=0.1, C=1.0, D=0.0), "dead_time: 0.5 s are no whole number"),
    ],
)
def test_wrong_systems_get_a_sentence(given: Any, told: str) -> None:
    late = 0.5 if "dead_time" in told else 0.0
    with pytest.raises(InputError, match=told):
        LoopModel.from_system(given, 1.0, dead_time=late)


def test_wrong_numbers_and_sections_get_a_sentence() -> None:
    with pytest.raises(InputError, match=r"^sample_time: None is no number"):
        LoopModel.from_system(LAG, None)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="unknown key 'contoller'"):
        LoopModel.from_system(LAG, 1.0, contoller={})


def test_systems_of_python_control_are_read() -> None:
    control = pytest.importorskip("control")
    lag = control.tf([0.8], [8.0, 1.0])
    for system in (lag, control.ss(lag), control.c2d(control.ss(lag), 1.0)):
        assert step(LoopModel.from_system(system, 1.0)) == pytest.approx(
            -0.8 * np.expm1(-TIME / 8.0)
        )
