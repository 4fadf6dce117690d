"""Sampled equations as continuous plants behind a held stem."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.signal import cont2discrete

from stiction_ros.discrepancy.simulation.equation import Changeable, held, later, slower, zeros_of
from stiction_ros.effects import FloatArray
from stiction_ros.processes import ArxOutput

LAGS = st.floats(1.5, 30.0)


def lag(gain: float, time: float, fraction: float) -> tuple[FloatArray, FloatArray]:
    """Return the equation of a lag that answers so much of a sample late: published formulas."""
    keep, early = math.exp(-1.0 / time), math.exp(-(1.0 - fraction) / time)
    b = np.array([gain * (1.0 - early), gain * (early - keep)])
    return np.array([1.0, -keep]), b if fraction else b[:1]


def sampled(zeros: list[float], poles: list[float], gain: float) -> tuple[FloatArray, FloatArray]:
    """Return the equation of gain · Π(1 + z s) / Π(1 + τ s) under a held stem, by scipy."""
    over = gain * np.array([1.0])
    for zero in zeros:
        over = np.polymul(over, [zero, 1.0])
    under = np.array([1.0])
    for pole in poles:
        under = np.polymul(under, [pole, 1.0])
    b, a, _ = cont2discrete((over, under), 1.0)
    return np.asarray(a), np.asarray(b[0][1:])


@given(st.floats(0.1, 3.0), LAGS, st.floats(0.05, 0.95), st.floats(-2.0, 2.0))
def test_a_dead_time_is_exact_between_samples(
    gain: float, time: float, fraction: float, more: float
) -> None:
    late = fraction + more
    assume(abs(late - round(late)) > 1e-4)  # a whole sample more, or all of one: the same
    plant = held(*map(tuple, lag(gain, time, fraction)))
    assert plant is not None
    assert plant.fraction == pytest.approx(fraction, abs=1e-5)
    moved, whole = later(plant, more)
    wanted = lag(gain, time, late % 1.0)[1]
    assert whole == math.floor(late)
    assert moved.sampled()[: len(wanted)] == pytest.approx(wanted, rel=1e-4, abs=1e-7)


def test_time_constants_and_leads_are_changed_each_by_itself() -> None:
    a, b = sampled([-3.0], [12.0, 5.0], 0.7)
    plant = held(tuple(a), tuple(b))
    assert plant is not None
    stretches = np.where(np.abs(1.0 / plant.poles.real) > 8.0, 1.1, 0.9)
    found = slower(plant, stretches, np.full(len(zeros_of(plant)), 1.2))
    wanted = sampled([-3.6], [13.2, 4.5], 0.7)[1]
    assert found.sampled()[:2] == pytest.approx(wanted, rel=1e-6)


def test_what_is_no_held_plant_is_none() -> None:
    assert held((1.0, 0.5), (1.0,)) is None  # alternates
    assert held((1.0, -0.5, 0.0), (1.0,)) is None  # dead time as a pole
    assert held((1.0, -0.5), (1.0, 1.0, 1.0)) is None


def equation(a: FloatArray, b: FloatArray, delay: int) -> ArxOutput:
    return ArxOutput("PV1", tuple(a.tolist()), {"V1": tuple(b.tolist())}, {"V1": delay})


def answer(own: ArxOutput, count: int = 200) -> FloatArray:
    """Return the response to a step, shape (count,)."""
    values = np.zeros(count)
    past = len(own.a)
    stem = np.ones(count)
    for k in range(count):
        for i in range(min(past, k)):
            values[k] -= own.a[i] * values[k - 1 - i]
        for i, b in enumerate(own.b["V1"]):
            at = k - 1 - own.delay["V1"] - i
            values[k] += b * stem[at] if at >= 0 else 0.0
    return values


def test_every_figure_of_an_equation_moves_what_it_says() -> None:
    a, b = sampled([], [12.0, 5.0], 0.7)
    changeable = Changeable(equation(a[1:], b, 3))
    kinds = [figure.what for figure in changeable.figures]
    assert kinds == ["gain", "delay", "time_constant", "time_constant"]
    assert sorted(f.lasts for f in changeable.figures if f.lasts) == pytest.approx([5.0, 12.0])
    louder = changeable.changed(np.array([0.1, 0.0, 0.0, 0.0]))
    assert answer(louder) == pytest.approx(1.1 * answer(changeable.own), rel=1e-9)
    late = changeable.changed(np.array([0.0, 2.0, 0.0, 0.0]))
    assert answer(late)[2:] == pytest.approx(answer(changeable.own)[:-2], abs=1e-9)
    slow = changeable.changed(np.array([0.0, 0.0, 0.1, 0.1]))
    assert answer(slow)[-1] == pytest.approx(0.7, rel=1e-3)
    assert answer(slow)[20] < answer(changeable.own)[20]
    gone = changeable.changed(
        np.array([0.0, 0.0, *(figure.least for figure in changeable.figures[2:])])
    )
    assert answer(gone)[6:] == pytest.approx(0.7, rel=1e-3)


def test_other_equations_have_means_of_whole_dead_times() -> None:
    own = equation(np.array([0.5]), np.array([1.0]), 2)
    late = Changeable(own).changed(np.array([0.0, 0.5]))
    assert late.delay == {"V1": 2}
    assert late.b["V1"] == pytest.approx([0.5, 0.5])
