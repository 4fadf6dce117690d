"""Valves of the field: their laws, and what a slow triangle shows."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from stiction_ros.errors import InputError
from stiction_studies.field.valves import Law, Stem, Valve, slow_triangle


@settings(max_examples=20)
@given(static=st.floats(0.5, 8.0), share=st.floats(0.1, 0.9))
@example(static=1.0, share=0.126953125)
def test_the_triangle_shows_the_parameters_of_he_s_law(static: float, share: float) -> None:
    """The band is a mean over half a leg, which need not hold whole slips."""
    shown = slow_triangle(Valve(Law.HE, static, share * static))
    assert shown.band == pytest.approx((1.0 + share) * static, rel=0.05)
    assert shown.jump == pytest.approx((1.0 - share) * static, rel=0.02, abs=0.02 * static)


@settings(max_examples=20)
@given(half=st.floats(0.05, 5.0))
def test_the_triangle_shows_the_band_of_a_backlash_and_no_jump(half: float) -> None:
    shown = slow_triangle(Valve(Law.BACKLASH, half, half))
    assert shown.band == pytest.approx(2.0 * half, rel=0.01)
    assert shown.jump == 0.0


@pytest.mark.parametrize("law", [Law.KARNOPP, Law.LUGRE])
@pytest.mark.parametrize("damping", [0.5, 1.5])
@pytest.mark.parametrize("positioner", [0.0, 1.0])
def test_band_and_jump_of_a_stem_belong_together(
    law: Law, damping: float, positioner: float
) -> None:
    """Behind a slip the lag is smaller by the slip: on average f_S less half of it."""
    stem = Stem(0.05, damping, 0.1, positioner, stribeck=0.06)
    shown = slow_triangle(Valve(law, 3.0, 2.0, stem))
    assert 0.8 < shown.jump <= 2.0
    creeping = 0.02 if law is Law.KARNOPP else 0.1  # bristles bend before they slip
    assert shown.band == pytest.approx(2.0 * 3.0 - shown.jump, rel=creeping)


@pytest.mark.parametrize("law", [Law.KARNOPP, Law.LUGRE])
def test_the_lag_of_an_actuator_counts_behind_a_positioner_alone(law: Law) -> None:
    """A stem that slips takes back the positioner's push no faster than the pressure falls."""

    def shown(positioner: float, lag: float) -> tuple[float, float]:
        ramped = slow_triangle(Valve(law, 3.0, 2.0, Stem(0.05, 1.5, lag, positioner, 100.0, 0.06)))
        return ramped.band, ramped.jump

    assert shown(0.0, 0.5) == pytest.approx(shown(0.0, 0.05), rel=0.05)
    (late, far), (quick, near) = shown(3.0, 0.5), shown(3.0, 0.05)
    assert far > 1.3 * near
    assert late < 0.9 * quick


def test_a_stem_that_is_barely_damped_slips_farther() -> None:
    light, heavy = (
        slow_triangle(Valve(Law.KARNOPP, 3.0, 2.0, Stem(0.05, damping))) for damping in (0.3, 3.0)
    )
    assert light.jump > 1.3 * heavy.jump


@pytest.mark.parametrize("law", list(Law))
def test_a_valve_without_friction_goes_where_it_is_told(law: Law) -> None:
    valve = Valve(law, 2.0, 1.0).without_friction()
    commands = 50.0 + np.cumsum(np.random.default_rng(1).standard_normal(50))
    assert valve.follow(commands, 5.0) == pytest.approx(commands, abs=1e-2)
    assert slow_triangle(valve).band == 0.0


@pytest.mark.parametrize("law", list(Law))
def test_a_stem_stays_while_the_command_is_near(law: Law) -> None:
    commands = 50.0 + np.array([0.0, 0.9, 1.8, 0.0, -1.8, 0.5])
    path = Valve(law, 2.0, 1.9).follow(commands, 2.0)
    assert np.ptp(path) <= 0.1


@pytest.mark.parametrize(("static", "sliding"), [(1.0, 2.0), (-1.0, -2.0), (np.nan, 0.0)])
def test_impossible_frictions_are_refused(static: float, sliding: float) -> None:
    with pytest.raises(InputError, match="no frictions"):
        Valve(Law.HE, static, sliding)
