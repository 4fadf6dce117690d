"""The scan equals plain least squares, whatever the prefilter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.identification.delay_kernels import pattern_energy, room_for
from stiction_ros.identification.output_error import Orders
from stiction_ros.identification.scan import OutputScan
from stiction_ros.identification.step_signals import StepSignals


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 1000), na=st.integers(1, 3), nb=st.integers(1, 3))
def test_one_step_criterion_is_the_least_squares_one(seed: int, na: int, nb: int) -> None:
    generator = np.random.default_rng(seed)
    y = generator.standard_normal(200)
    stems = generator.standard_normal((200, 3)).cumsum(axis=0)
    orders = Orders(na, nb, 2, 20)
    one = np.ones(1)
    scan = OutputScan(y, np.empty((0, 200)), (), orders, (0, 4), one, one)
    energy = scan.energy(StepSignals.of(stems))
    for g in range(3):
        for delay in range(5):
            columns = [y[20 - i : 200 - i] for i in range(1, na + 1)]
            columns += [stems[20 - delay - i : 200 - delay - i, g] for i in range(1, nb + 1)]
            matrix = np.column_stack([*columns, np.ones(180)])
            rest = y[20:] - matrix @ np.linalg.lstsq(matrix, y[20:], rcond=None)[0]
            assert energy[g, delay] == pytest.approx(rest @ rest, rel=1e-6)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 1000), nb=st.integers(1, 3), p=st.integers(0, 2))
def test_pattern_energy_is_that_of_the_stem_it_stands_for(seed: int, nb: int, p: int) -> None:
    generator = np.random.default_rng(seed)
    y = generator.standard_normal(150)
    other = generator.standard_normal((1, 150)).cumsum(axis=1)
    bases = generator.standard_normal((150, 4)).cumsum(axis=0)
    signs = generator.choice([-1.0, 0.0, 1.0], (150, 4))
    levels = generator.random((4, 3))
    a, d = np.array([1.0, -0.8]), np.array([1.0, 0.3, 0.1])[: p + 1]
    scan = OutputScan(y, other, (1,), Orders(1, nb, p, 20), (0, 3), d, a)
    found = scan.patterns(StepSignals.of(bases, signs))
    energy, room = np.empty((4, found.delays)), room_for(nb, 3 + nb)
    for f in range(3):
        for g in range(4):
            parts = found.products[g], found.rights[g]
            pattern_energy(*parts, levels[g, f], scan.rest_energy, room, energy[g])
        expected = scan.energy(StepSignals.of(bases - levels[:, f] * signs))
        assert energy == pytest.approx(expected, rel=1e-7)


def test_stem_that_the_rest_explains_to_the_last_digit_explains_nothing() -> None:
    generator = np.random.default_rng(0)
    y = 1e3 * generator.standard_normal(300).cumsum()
    stems = np.stack([np.roll(y, 2), np.full(300, 1e6), np.zeros(300), y[::-1]], axis=1)
    one = np.ones(1)
    scan = OutputScan(y, np.empty((0, 300)), (), Orders(4, 2, 0, 20), (0, 3), one, one)
    energy = scan.energy(StepSignals.of(stems))
    assert np.isfinite(energy).all()
    assert energy[1:3] == pytest.approx(scan.rest_energy, rel=1e-6)
    assert (energy[0] > 0.9 * scan.rest_energy).all()
