"""Plants in continuous time, and the equations that are given of them."""

import dataclasses

import numpy as np
import pytest
from scipy.signal import lfilter

from stiction_studies.field.hidden.plants import FINE, KINDS, Plant, drawn_plant
from stiction_studies.field.hidden.simulation import AT_REST, Base, Signals, run
from stiction_studies.field.hidden.tuning import calmed, closed_radius, simc, tight

every_kind = pytest.mark.parametrize("kind", KINDS)
SAMPLE_TIME = 2.0


def quiet(set_point: np.ndarray, by_hand: float = np.nan) -> Signals:
    zeros = np.zeros(len(set_point))
    return Signals(set_point, zeros, zeros, np.full(len(set_point), by_hand))


@every_kind
def test_the_sampled_equation_is_exact_under_a_stem_that_is_held(kind: str) -> None:
    random = np.random.default_rng(5)
    for _ in range(3):
        plant = drawn_plant(random, kind, SAMPLE_TIME)
        tuning = calmed(plant, SAMPLE_TIME, 1, simc(plant, SAMPLE_TIME, 2.0))
        unit = abs(plant.gain) * (60.0 if plant.integrating else 1.0)
        set_point = AT_REST + np.where(np.arange(600) % 200 < 100, 2.0, -1.0) * unit
        out = run(Base(plant, tuning, SAMPLE_TIME, 1, False), quiet(set_point))
        a, b, delay = plant.sampled(SAMPLE_TIME)
        by_equation = lfilter([*np.zeros(delay + 1), *b], [1.0, *a], out.op - AT_REST)
        assert np.ptp(out.clean) > unit
        assert out.clean == pytest.approx(AT_REST + by_equation, abs=1e-9 * np.ptp(out.clean))


def test_a_record_of_every_second_scan_has_the_dead_time_of_the_plant() -> None:
    plant = Plant("flow", 1.5, (10.0, 4.0), 0.0, 5.0 / FINE)
    by_hand = np.repeat(AT_REST + np.random.default_rng(2).standard_normal(150), 2)
    base = Base(plant, simc(plant, 1.0, 2.0), 1.0, 1, False)
    clean = run(base, Signals(np.full(300, AT_REST), *np.zeros((2, 300)), by_hand)).clean[::2]
    a, b, delay = plant.sampled(2.0, 2 * FINE)
    by_equation = lfilter([*np.zeros(delay + 1), *b], [1.0, *a], by_hand[::2] - AT_REST)
    assert clean == pytest.approx(AT_REST + by_equation, abs=1e-9)


def test_a_step_ends_at_the_gain_and_comes_after_the_dead_time() -> None:
    plant = Plant("flow", 1.5, (10.0, 4.0), 0.0, 7.0)
    base = Base(plant, simc(plant, 1.0, 2.0), 1.0, 1, False)
    out = run(base, quiet(np.full(300, AT_REST), by_hand=AT_REST + 2.0))
    assert not out.clean[:8].any() or np.ptp(out.clean[:8]) == 0.0
    assert out.clean[9] > AT_REST
    assert out.clean[-1] == pytest.approx(AT_REST + 3.0)
    time = np.arange(300) - 7.0
    answer = 3.0 * (1.0 - (10.0 * np.exp(-time / 10.0) - 4.0 * np.exp(-time / 4.0)) / 6.0)
    assert out.clean[8:] == pytest.approx(AT_REST + answer[8:])


def test_a_lead_below_zero_begins_the_wrong_way() -> None:
    plant = Plant("wrong_way", 1.0, (10.0, 5.0), -3.0)
    out = run(
        Base(plant, simc(plant, 1.0, 2.0), 1.0, 1, False), quiet(np.full(200, 50.0), by_hand=51.0)
    )
    assert out.clean[2] < AT_REST
    assert out.clean[-1] == pytest.approx(51.0)


def test_an_integrator_that_loses_settles_at_gain_over_decay() -> None:
    plant = Plant("level", 0.02, (2.0,), integrating=True, decay=0.05)
    out = run(
        Base(plant, simc(plant, 1.0, 2.0), 1.0, 1, False), quiet(np.full(400, 50.0), by_hand=52.0)
    )
    assert out.clean[-1] == pytest.approx(50.0 + 2.0 * 0.02 / 0.05)


@every_kind
def test_loops_are_calm_or_nearly_swing_as_wanted(kind: str) -> None:
    random = np.random.default_rng(8)
    plant = drawn_plant(random, kind, SAMPLE_TIME)
    tuning = calmed(plant, SAMPLE_TIME, 1, simc(plant, SAMPLE_TIME, 2.0))
    assert closed_radius(plant, SAMPLE_TIME, 1, tuning) < 1.0
    if not plant.integrating:
        harder = tight(plant, SAMPLE_TIME, 1, tuning, 60.0)
        assert abs(harder.gain) > abs(tuning.gain)
        radius = closed_radius(plant, SAMPLE_TIME, 1, harder)
        assert radius == pytest.approx(np.exp(-1.0 / 60.0), abs=1e-3)


def test_dead_times_are_whole_fine_steps() -> None:
    random = np.random.default_rng(3)
    for kind in KINDS:
        plant = drawn_plant(random, kind, SAMPLE_TIME)
        steps = plant.dead_time * FINE / SAMPLE_TIME
        assert steps == pytest.approx(round(steps))
        longer = dataclasses.replace(plant, dead_time=plant.dead_time + SAMPLE_TIME)
        assert longer.fine_dead_time(SAMPLE_TIME) == plant.fine_dead_time(SAMPLE_TIME) + FINE
