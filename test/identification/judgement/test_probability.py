"""The figures behind a verdict, the probability that they give, and the cuts through it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.identification import VerdictKind
from stiction_ros.identification.judgement.figures import Figures, definitions
from stiction_ros.identification.judgement.probability import (
    SURE,
    coefficients,
    contributions,
    friction_probability,
    verdict_of,
)

VALUES = st.floats(-1e6, 1e6)


@st.composite
def figures(draw: st.DrawFn) -> Figures:
    return Figures(**{name: draw(VALUES) for name in definitions()})


def test_at_most_twelve_figures_each_with_a_unit_and_a_definition() -> None:
    assert len(definitions()) <= 12
    assert all(unit and len(text) > 10 for unit, text in definitions().values())
    assert len(coefficients()) == 1 + len(definitions())


@given(figures())
def test_every_figure_gives_one_finite_feature_and_a_probability(told: Figures) -> None:
    assert np.isfinite(told.features()).all()
    assert 0.0 <= friction_probability(told) <= 1.0


@given(figures())
def test_the_contributions_are_the_log_odds(told: Figures) -> None:
    odds = coefficients()[0] + sum(contributions(told).values())
    expected = 1.0 / (1.0 + np.exp(-np.clip(odds, -30.0, 30.0)))
    assert friction_probability(told) == pytest.approx(expected, abs=1e-9)


@given(figures(), st.floats(0.0, 1e5))
def test_more_gain_never_makes_friction_less_likely(told: Figures, more: float) -> None:
    higher = dataclasses.replace(told, gain=told.gain + more)
    assert friction_probability(higher) >= friction_probability(told) - 1e-12


@pytest.mark.parametrize(
    ("probability", "ruled_out", "deadband", "verdict"),
    [
        (SURE, 0.0, False, VerdictKind.STICKY),
        (SURE, 0.0, True, VerdictKind.BACKLASH),
        (0.9, 5.0, False, VerdictKind.UNDECIDED),
        (0.04, 5.0, False, VerdictKind.HEALTHY),
        (0.04, -1.0, False, VerdictKind.UNDECIDED),
    ],
)
def test_a_verdict_is_a_cut(
    probability: float, ruled_out: float, deadband: bool, verdict: VerdictKind
) -> None:
    told = Figures(**{**dict.fromkeys(definitions(), 0.0), "ruled_out": ruled_out})
    assert verdict_of(probability, told, deadband) is verdict
