import numpy as np
import pytest

from stiction_ros.identification.linear.response_prior import DECAYS, SIZES, ResponsePrior


@pytest.mark.parametrize("decay", range(len(DECAYS)))
@pytest.mark.parametrize("taps", [2, 7, 20])
def test_precision_is_the_inverse_of_the_kernel_that_the_docstring_names(
    decay: int, taps: int
) -> None:
    prior, edges = ResponsePrior(decay, 3), np.arange(taps + 1)
    lags = np.arange(1, taps + 1)
    kernel = SIZES[3] * DECAYS[decay] ** np.maximum.outer(lags, lags)
    assert prior.precision(edges) @ kernel == pytest.approx(np.eye(taps), abs=1e-6)
    assert prior.log_determinant(edges) == pytest.approx(np.linalg.slogdet(kernel)[1], abs=1e-6)


def test_neighbours_stay_within_the_family_and_hold_the_member_itself() -> None:
    for decay in range(len(DECAYS)):
        for size in range(len(SIZES)):
            prior = ResponsePrior(decay, size)
            near = prior.neighbours()
            assert prior in near
            assert all(0 <= n.decay < len(DECAYS) and 0 <= n.size < len(SIZES) for n in near)
