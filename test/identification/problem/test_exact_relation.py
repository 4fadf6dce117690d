"""Stretches that obey an exact relation are found, and no others."""

import numpy as np
import pytest

from stiction_ros.identification.problem.exact_relation import explained_stretches

WIDTH = 30


@pytest.mark.parametrize("count", [1, 8, 11])
@pytest.mark.parametrize("least", [0, 1])
def test_as_by_least_squares(count: int, least: int) -> None:
    generator = np.random.default_rng(count)
    own, others = generator.standard_normal(500), generator.standard_normal((2, 500))
    for k in range(2, 300):  # the second part is noise
        past = 0.5 * own[k - 1] - 0.2 * own[k - 2] + others[0, k - 1] - 0.3 * others[1, k - 2]
        own[k] = past + (0.7 * others[0, k] if least == 0 else 0.0)
    starts = np.linspace(0, 500 - WIDTH - 2, count).astype(np.int64)
    found = explained_stretches(own, others, (2, least), starts, WIDTH, 1e-7)
    for start, explained in zip(starts, found, strict=True):
        rows = start + 2 + np.arange(WIDTH)
        columns = [own[rows - 1], own[rows - 2]]
        columns += [other[rows - lag] for other in others for lag in range(least, 3)]
        left = np.linalg.lstsq(np.stack(columns, axis=1), own[rows], rcond=None)[1]
        assert explained == bool(left.sum() < 1e-12)
