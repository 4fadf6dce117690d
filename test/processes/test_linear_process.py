from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import cont2discrete

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.processes import (
    ArxOutput,
    ArxProcess,
    LinearModel,
    Noise,
    NoiseEntry,
    Process,
    StateSpaceProcess,
)

A18 = (-2.0914, 1.3749, -0.2725)
B18 = (0.002445, 0.007181, 0.001278)


def free_run(process: Process, state: np.ndarray, stems: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Outputs at samples 0 … N − 1; ``v[k]`` is the equation noise of sample k."""
    out, none = [], np.zeros(len(process.upsets))
    for k in range(len(stems)):
        out.append(process.output(state))
        following = v[k + 1] if k + 1 < len(v) else np.zeros(v.shape[1])
        state = process.advance(state, stems[k], none, following)
    return np.array(out)


def equation_7(
    equation: ArxOutput, valves: Sequence[str], stems: np.ndarray, v: np.ndarray
) -> np.ndarray:
    """The literal difference equation from rest at zero, deviations in and out."""
    y = np.zeros(len(stems))
    for k in range(1, len(stems)):
        for i, a in enumerate(equation.a, start=1):
            y[k] -= a * (y[k - i] if k >= i else 0.0)
        for valve, coefficients in equation.b.items():
            for i, b in enumerate(coefficients, start=1):
                at = k - i - equation.delay[valve]
                y[k] += b * (stems[at, valves.index(valve)] if at >= 0 else 0.0)
        y[k] += equation.bias + v[k]
    return y


def test_equation_18_is_the_zero_order_hold_of_17_within_its_digits() -> None:
    denominator = np.polymul(np.polymul([10.0, 1.0], [5.0, 1.0]), [1.0, 1.0])
    b, a, _ = cont2discrete(([1.0], denominator), 1.0, method="zoh")
    assert np.round(a[1:], 4) == pytest.approx(A18, abs=1e-12)
    assert np.abs(b[0, 1:] - B18).max() < 5e-6


def test_equation_18_has_gain_0_991() -> None:
    model = LoopModel.load(find_config("example1.loop.yaml")).process.linear(1.0)
    assert model.gain[0, 0] == pytest.approx(sum(B18) / (1.0 + sum(A18)))
    # Its denominator sums to 0.011, so a rounded digit of (18) moves the gain by percents.
    assert model.gain[0, 0] == pytest.approx(0.991, abs=5e-4)


def test_the_config_of_example_1_is_equation_18() -> None:
    process = LoopModel.load(find_config("example1.loop.yaml")).process
    assert isinstance(process, ArxProcess)
    (equation,) = process.equations
    assert (equation.a, equation.b, equation.delay) == (A18, {"V1": B18}, {"V1": 5})


@st.composite
def arx_outputs(draw: st.DrawFn, name: str = "Y1", valves: tuple[str, ...] = ("V1",)) -> ArxOutput:
    small = st.floats(-0.4, 0.4)
    used = draw(st.sets(st.sampled_from(valves), min_size=1))
    return ArxOutput(
        name,
        tuple(draw(st.lists(small, max_size=3))),
        {v: tuple(draw(st.lists(small, min_size=1, max_size=3))) for v in sorted(used)},
        {v: draw(st.integers(0, 6)) for v in sorted(used)},
        draw(st.floats(-1.0, 1.0)),
    )


@given(arx_outputs(), st.integers(0, 2**32 - 1))
def test_observer_form_is_the_difference_equation(equation: ArxOutput, seed: int) -> None:
    random = np.random.default_rng(seed)
    stems, v = random.normal(size=(25, 1)), random.normal(size=(25, 1))
    process = ArxProcess((equation,), ("V1",), np.zeros(1), np.zeros(1))
    v[0] = 0.0
    y = free_run(process, np.zeros(process.model.order), stems, v)
    assert y[:, 0] == pytest.approx(equation_7(equation, ("V1",), stems, v[:, 0]), abs=1e-9)


@given(st.data(), st.integers(0, 2**32 - 1))
def test_mimo_outputs_are_their_equations_side_by_side(data: st.DataObject, seed: int) -> None:
    valves = ("V1", "V2", "V3")
    equations = tuple(data.draw(arx_outputs(name, valves)) for name in ("Y1", "Y2"))
    random = np.random.default_rng(seed)
    stems, v = random.normal(size=(20, 3)), np.zeros((20, 2))
    process = ArxProcess(equations, valves, np.zeros(3), np.zeros(2))
    y = free_run(process, np.zeros(process.model.order), stems, v)
    for i, equation in enumerate(equations):
        assert y[:, i] == pytest.approx(equation_7(equation, valves, stems, v[:, i]), abs=1e-9)


@given(arx_outputs(), st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_about_an_operating_point_it_works_in_deviations(
    equation: ArxOutput, op0: float, pv0: float
) -> None:
    stems = np.random.default_rng(3).normal(size=(15, 1))
    about_zero = ArxProcess((equation,), ("V1",), np.zeros(1), np.zeros(1))
    about_point = ArxProcess((equation,), ("V1",), np.array([op0]), np.array([pv0]))
    start, v = np.zeros(about_zero.model.order), np.zeros((15, 1))
    moved = free_run(about_point, start, stems + op0, v)
    assert moved == pytest.approx(free_run(about_zero, start, stems, v) + pv0, abs=1e-9)


def test_a_delay_shows_the_first_reaction_at_sample_1_plus_delay() -> None:
    equation = ArxOutput("Y1", (), {"V1": (1.0,)}, {"V1": 4})
    process = ArxProcess((equation,), ("V1",), np.zeros(1), np.zeros(1))
    stems = np.ones((8, 1))
    y = free_run(process, np.zeros(process.model.order), stems, np.zeros((8, 1)))
    assert y[:, 0].tolist() == [0, 0, 0, 0, 0, 1, 1, 1]


@given(arx_outputs(), st.floats(-20.0, 20.0))
def test_rest_at_a_steady_state_stays_there(equation: ArxOutput, stem: float) -> None:
    # |a| sums to at most 1.2; keep to those that have one steady state and are stable.
    if sum(abs(a) for a in equation.a) > 0.9:
        equation = ArxOutput(equation.name, (), equation.b, equation.delay, equation.bias)
    process = ArxProcess((equation,), ("V1",), np.zeros(1), np.zeros(1))
    drive = sum(equation.b["V1"]) * stem + equation.bias
    steady = np.array([drive / (1.0 + sum(equation.a))])
    state = process.rest(np.array([stem]), steady)
    y = free_run(process, state, np.full((10, 1), stem), np.zeros((10, 1)))
    assert y == pytest.approx(np.tile(steady, (10, 1)), abs=1e-9)


def test_rest_off_the_steady_state_shows_the_wanted_output_first() -> None:
    process = LoopModel.load(find_config("example1.loop.yaml")).process
    state = process.rest(np.array([50.0]), np.array([53.0]))
    assert process.output(state) == pytest.approx([53.0])


def test_state_space_is_equation_2() -> None:
    random = np.random.default_rng(5)
    a, b = 0.3 * random.normal(size=(3, 3)), random.normal(size=(3, 2))
    c, e = random.normal(size=(2, 3)), random.normal(size=(3, 1))
    op0, pv0 = np.array([40.0, 60.0]), np.array([7.0, 8.0])
    model = LinearModel(a, b, c, e, np.zeros(3), op0, pv0)
    process = StateSpaceProcess(model, ("V1", "V2"), ("Y1", "Y2"), (Noise(), Noise()), ("D",))
    x, state = np.zeros(3), np.zeros(3)
    for _ in range(10):
        stem, upset = random.uniform(0, 100, 2), random.normal(size=1)
        assert process.output(state) == pytest.approx(c @ x + pv0)
        x = a @ x + b @ (stem - op0) + e @ upset
        state = process.advance(state, stem, upset, np.zeros(2))


def test_equation_noise_of_state_space_moves_the_next_output_by_itself() -> None:
    model = LoopModel.load(find_config("tank_linear.loop.yaml"))
    process = model.process
    noise = np.array([0.3, -0.2])
    state = process.rest(model.op0, model.pv0)
    quiet = process.advance(state, model.op0, np.zeros(0), np.zeros(2))
    noisy = process.advance(state, model.op0, np.zeros(0), noise)
    assert process.output(noisy) - process.output(quiet) == pytest.approx(noise)


def test_the_dc_gains_of_a3_are_those_of_facts() -> None:
    gain = LoopModel.load(find_config("tank_linear.loop.yaml")).process.linear(60.0).gain
    expected = [[0.02424, -0.00054], [-0.19005, 0.29754]]
    # Five decimals are quoted; the state-space matrices carry four to five digits.
    assert gain == pytest.approx(np.array(expected), abs=6e-6)


def test_the_poles_of_a3_lie_where_facts_puts_them() -> None:
    a = LoopModel.load(find_config("tank_linear.loop.yaml")).process.linear(60.0).a
    poles = np.abs(np.linalg.eigvals(a))
    assert (len(poles), poles.min(), poles.max()) == (
        5,
        pytest.approx(0.866, abs=2e-3),
        pytest.approx(0.970, abs=2e-3),
    )


def test_noise_std_is_split_by_where_it_enters() -> None:
    def output(name: str, noise: Noise) -> ArxOutput:
        return ArxOutput(name, (), {"V1": (1.0,)}, {"V1": 0}, noise=noise)

    equations = (output("A", Noise(0.1)), output("B", Noise(0.2, NoiseEntry.EQUATION)))
    process = ArxProcess(equations, ("V1",), np.zeros(1), np.zeros(2))
    assert process.noise_std(NoiseEntry.MEASUREMENT).tolist() == [0.1, 0.0]
    assert process.noise_std(NoiseEntry.EQUATION).tolist() == [0.0, 0.2]


@pytest.mark.parametrize(
    ("b", "delay"), [({"V1": (1.0,)}, {}), ({"V1": (1.0,)}, {"V1": -1}), ({"V1": ()}, {"V1": 0})]
)
def test_equations_that_do_not_fit_together_are_refused(
    b: dict[str, tuple[float, ...]], delay: dict[str, int]
) -> None:
    with pytest.raises(InputError) as caught:
        ArxOutput("Y1", (), b, delay)
    assert caught.value.where == "Y1"


def test_disturbances_without_columns_are_refused() -> None:
    model = LinearModel(
        np.eye(1) / 2, np.eye(1), np.eye(1), np.zeros((1, 0)), np.zeros(1), np.zeros(1), np.zeros(1)
    )
    with pytest.raises(InputError) as caught:
        StateSpaceProcess(model, ("V1",), ("Y1",), (Noise(),), ("D",))
    assert (caught.value.where, bool(caught.value.fix)) == ("e", True)
