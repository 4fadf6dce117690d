"""Scores of chance, stored and drawn."""

from __future__ import annotations

import numpy as np
import pytest

from stiction_ros.discrepancy.fit.uncertainty import FEW_CANDIDATES, SCORE_OF_FEW, stored_threshold
from stiction_studies.blind.calibration import ChanceScore, chance_scores


@pytest.fixture(scope="module")
def scores() -> list[ChanceScore]:
    return list(chance_scores([1, 2], 2))


def test_the_stored_threshold_grows_with_the_logarithm_of_the_candidates() -> None:
    steps = np.diff([stored_threshold(FEW_CANDIDATES * factor) for factor in (1, 2, 4, 8)])
    np.testing.assert_allclose(steps, steps[0])
    assert steps[0] > 0.0


def test_the_stored_threshold_of_one_loop_is_what_was_calibrated() -> None:
    assert stored_threshold(FEW_CANDIDATES) == pytest.approx(SCORE_OF_FEW)


@pytest.mark.trial
def test_scores_of_noise_alone_stay_below_the_margin(scores: list[ChanceScore]) -> None:
    assert len(scores) == 4
    assert max(each.evidence for each in scores) < 10.0


@pytest.mark.trial
def test_scores_of_noise_are_drawn_from_the_seed(scores: list[ChanceScore]) -> None:
    assert next(chance_scores([2], 2)) == scores[2] != scores[3]
