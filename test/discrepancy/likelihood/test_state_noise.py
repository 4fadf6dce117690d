"""Noise by its states, judged from the first sample of a record on."""

import numpy as np
import pytest

from stiction_ros.discrepancy.likelihood.state_noise import innovations

COUNT = 40
STEP, WHITE = 0.3, 0.5  # variances of a walk and of the measurements


def filtered(values: np.ndarray, seen: np.ndarray, begins: np.ndarray) -> tuple[np.ndarray, ...]:
    one = np.ones((1, 1))
    return innovations(one, STEP * one, np.ones(1), WHITE, 0.0 * one, values, seen, begins)


def first_row() -> np.ndarray:
    begins = np.zeros(COUNT, dtype=bool)
    begins[0] = True
    return begins


@pytest.mark.parametrize("gone", [(), (7, 8, 21)])
def test_the_likelihood_is_that_of_the_covariance(gone: tuple[int, ...]) -> None:
    values = np.random.default_rng(1).normal(0.0, 2.0, (1, COUNT))
    seen = np.ones(COUNT, dtype=bool)
    seen[list(gone)] = False
    white, variances = filtered(values, seen, first_row())
    at = np.arange(COUNT)
    covariance = STEP * np.minimum.outer(at, at) + WHITE * np.eye(COUNT)
    part = covariance[np.ix_(seen, seen)]
    whole = values[0, seen] @ np.linalg.solve(part, values[0, seen])
    assert float(white[0, seen] @ white[0, seen]) == pytest.approx(whole)
    assert np.log(variances[seen]).sum() == pytest.approx(np.linalg.slogdet(part)[1])


def test_every_record_begins_anew() -> None:
    values = np.random.default_rng(2).normal(0.0, 2.0, (1, COUNT))
    begins = first_row()
    begins[25] = True
    white, variances = filtered(values, np.ones(COUNT, dtype=bool), begins)
    assert variances[25] == WHITE
    assert white[0, 25] == pytest.approx(values[0, 25] / np.sqrt(WHITE))


def test_what_a_column_adds_is_added_to_what_is_missed() -> None:
    values = np.random.default_rng(3).normal(0.0, 2.0, (2, COUNT))
    both = np.vstack([values, values.sum(axis=0)])
    white, _ = filtered(both, np.ones(COUNT, dtype=bool), first_row())
    assert white[2] == pytest.approx(white[0] + white[1])
