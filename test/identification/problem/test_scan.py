"""The scan equals plain least squares, whatever the prefilter."""

import dataclasses

import numpy as np
import pytest
import simulated_loops as loops
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from stiction_ros.effects import FloatArray
from stiction_ros.identification import IdentificationOptions
from stiction_ros.identification.kernels.delay import left_over
from stiction_ros.identification.kernels.level import best_levels
from stiction_ros.identification.problem.models import Model, linear_model, refit
from stiction_ros.identification.problem.output_error import Orders
from stiction_ros.identification.problem.preparation import prepare, window
from stiction_ros.identification.problem.scan import OutputScan
from stiction_ros.identification.switching import StepSignals


def energy_of(scan: OutputScan, stems: StepSignals) -> FloatArray:
    """Return SE of each stem at each delay, shape (G, T)."""
    products, rights = scan.products(stems)
    energy = np.empty((stems.size, scan.delays))
    for own, right, out in zip(products, rights, energy, strict=True):
        left_over(own[0], right[0], scan.rest_energy, out)
    return energy


@given(seed=st.integers(0, 1000), na=st.integers(1, 3), nb=st.integers(1, 3))
def test_one_step_criterion_is_the_least_squares_one(seed: int, na: int, nb: int) -> None:
    generator = np.random.default_rng(seed)
    y = generator.standard_normal(200)
    stems = generator.standard_normal((200, 3)).cumsum(axis=0)
    orders = Orders(na, nb, 2, 20)
    one = np.ones(1)
    scan = OutputScan(y, np.empty((0, 200)), (), orders, (0, 4), one, one)
    energy = energy_of(scan, StepSignals.of(stems))
    for g in range(3):
        for delay in range(5):
            columns = [y[20 - i : 200 - i] for i in range(1, na + 1)]
            columns += [stems[20 - delay - i : 200 - delay - i, g] for i in range(1, nb + 1)]
            matrix = np.column_stack([*columns, np.ones(180)])
            rest = y[20:] - matrix @ np.linalg.lstsq(matrix, y[20:], rcond=None)[0]
            assert energy[g, delay] == pytest.approx(rest @ rest, rel=1e-6)


@settings(max_examples=15)
@given(seed=st.integers(0, 1000), nb=st.integers(1, 3), p=st.integers(0, 2))
def test_the_best_level_of_a_pattern_is_that_of_the_stem_it_stands_for(
    seed: int, nb: int, p: int
) -> None:
    generator = np.random.default_rng(seed)
    y = generator.standard_normal(150)
    other = generator.standard_normal((1, 150)).cumsum(axis=1)
    bases = generator.standard_normal((150, 4)).cumsum(axis=0)
    signs = generator.choice([-1.0, 0.0, 1.0], (150, 4))
    levels = generator.random((4, 3))
    a, d = np.array([1.0, -0.8]), np.array([1.0, 0.3, 0.1])[: p + 1]
    scan = OutputScan(y, other, (1,), Orders(1, nb, p, 20), (0, 3), d, a)
    products, rights = scan.products(StepSignals.of(bases, signs))
    scales = np.array([[scan.rest_energy, scan.count, scan.delays]])
    for f in range(3):
        ranges = np.repeat(levels[:, f : f + 1], 2, axis=1)
        _, _, loss, delays = best_levels(products[:, None], rights[:, None], scales, ranges)
        expected = energy_of(scan, StepSignals.of(bases - levels[:, f] * signs))
        assert (delays[:, 0] == expected.argmin(axis=1)).all()
        energy = scan.count * np.exp(loss / scan.count)
        assert energy == pytest.approx(expected.min(axis=1), rel=1e-7)


def test_stem_that_the_rest_explains_to_the_last_digit_explains_nothing() -> None:
    generator = np.random.default_rng(0)
    y = 1e3 * generator.standard_normal(300).cumsum()
    stems = np.stack([np.roll(y, 2), np.full(300, 1e6), np.zeros(300), y[::-1]], axis=1)
    one = np.ones(1)
    scan = OutputScan(y, np.empty((0, 300)), (), Orders(4, 2, 0, 20), (0, 3), one, one)
    energy = energy_of(scan, StepSignals.of(stems))
    assert np.isfinite(energy).all()
    assert energy[1:3] == pytest.approx(scan.rest_energy, rel=1e-6)
    assert (energy[0] > 0.9 * scan.rest_energy).all()


@pytest.mark.parametrize("delays", [1, 7, 8, 9, 17])
@pytest.mark.parametrize(("count", "na", "filtered"), [(1, 2, True), (9, 1, False), (66, 4, True)])
def test_any_number_of_stems_and_delays(delays: int, count: int, na: int, filtered: bool) -> None:
    generator = np.random.default_rng(delays + count)
    y, stems = (
        generator.standard_normal(300),
        generator.standard_normal((300, count)).cumsum(axis=0),
    )
    a = np.poly(np.linspace(0.2, 0.6, na)) if filtered else np.ones(1)
    d = np.array([1.0, 0.4]) if filtered else np.ones(1)
    orders = Orders(na, 2, 1, 30)
    scan = OutputScan(y, np.empty((0, 300)), (), orders, (1, delays), d, a)
    energy = energy_of(scan, StepSignals.of(stems))
    y, ones, impulse = (lfilter(d, a, x) for x in (y, np.ones(300), np.eye(1, 300, 28 - na)[0]))
    shared = [y[30 - i : 300 - i] for i in range(1, na + 1)] + [ones[30:]]
    if filtered:
        shared += [impulse[30 - i : 300 - i] for i in range(na)]
    for g, delay in {(0, 1), (count - 1, delays), (count // 2, (delays + 1) // 2)}:
        stem = lfilter(d, a, stems[:, g])
        own = [stem[30 - delay - i : 300 - delay - i] for i in (1, 2)]
        matrix = np.column_stack([*shared, *own])
        rest = y[30:] - matrix @ np.linalg.lstsq(matrix, y[30:], rcond=None)[0]
        assert energy[g, delay - 1] == pytest.approx(rest @ rest, rel=1e-6)
    least, places = scan.least_energy(StepSignals.of(stems))
    assert (least == energy.min(axis=1)).all()
    assert (places == energy.argmin(axis=1)).all()


def test_a_window_that_begins_before_its_lags_is_refused() -> None:
    one = np.ones(1)
    with pytest.raises(ValueError, match="begins at 5"):
        OutputScan(np.zeros(100), np.empty((0, 100)), (), Orders(1, 1, 0, 5), (0, 9), one, one)


def test_delays_are_chosen_for_the_stems_that_a_model_has() -> None:
    record = loops.example1(1, samples=500)
    options = IdentificationOptions(output_order=1, delay=(3, 7))
    data, orders = prepare(record, options), window(options, 1, 1)
    late = np.ascontiguousarray(np.roll(data.u, 2, axis=1))
    wrong = Model(np.array([[5.0, 2.0]]), np.zeros(1), late, ((3,),), ())
    models = (dataclasses.replace(wrong, delays=((delay,),)) for delay in range(3, 8))
    least = min(refit(data, model, orders, warm=False).loss for model in models)
    assert linear_model(data, orders, wrong).loss == pytest.approx(least)
