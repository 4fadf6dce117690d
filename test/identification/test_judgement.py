"""The figures behind a verdict, the probability that they give, and the cuts through it."""

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.identification import VerdictKind
from stiction_ros.identification.judgement import (
    SURE,
    Figures,
    contributions,
    definitions,
    fitted_model,
    friction_probability,
    verdict_of,
)

VALUES, MORE = st.floats(-1e6, 1e6), st.floats(0.0, 1e5)


@st.composite
def figures(draw: st.DrawFn) -> Figures:
    return Figures(**{name: draw(VALUES) for name in definitions()})


def test_at_most_twelve_figures_each_with_a_unit_and_a_definition() -> None:
    assert len(definitions()) <= 12
    assert all(told["unit"] and len(told["definition"]) > 10 for told in definitions().values())
    asked = {node.figure for tree in fitted_model().trees for node in tree if node.figure}
    assert asked <= set(definitions())


@given(figures())
def test_the_contributions_are_the_log_odds(told: Figures) -> None:
    model = fitted_model()
    start = model.constant + sum(tree[0].value for tree in model.trees)
    odds = start + sum(contributions(told).values())
    assert friction_probability(told) == pytest.approx(1.0 / (1.0 + math.exp(-odds)), abs=1e-9)


@given(figures(), st.sampled_from([n for n in definitions() if definitions()[n]["sign"]]), MORE)
def test_a_figure_that_has_a_sign_acts_in_that_direction(
    told: Figures, name: str, more: float
) -> None:
    moved = getattr(told, name) + definitions()[name]["sign"] * more
    other = dataclasses.replace(told, **{name: moved})
    assert friction_probability(other) >= friction_probability(told) - 1e-4  # rounded values


@pytest.mark.parametrize(
    ("probability", "responds", "deadband", "verdict"),
    [
        (SURE, True, False, VerdictKind.STICKY),
        (SURE, True, True, VerdictKind.BACKLASH),
        (0.9, True, False, VerdictKind.UNDECIDED),
        (0.04, True, False, VerdictKind.HEALTHY),
        (0.04, False, False, VerdictKind.UNDECIDED),
    ],
)
def test_a_verdict_is_a_cut(
    probability: float, responds: bool, deadband: bool, verdict: VerdictKind
) -> None:
    assert verdict_of(probability, responds, deadband) is verdict
