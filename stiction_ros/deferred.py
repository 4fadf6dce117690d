"""What SciPy has in packages that load slowly: loaded at its first use, or not needed at all.

``scipy.signal`` and ``scipy.stats`` take half a second, longer than all else that a node or a
worker of a survey loads, and most of these never need them.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaincinv


def lfilter(
    numerator: ArrayLike, denominator: ArrayLike, values: ArrayLike, axis: int = -1
) -> NDArray[np.float64]:
    """Return ``values`` filtered along ``axis`` from rest, as ``scipy.signal.lfilter`` does."""
    from scipy.signal import lfilter as filtered

    return np.asarray(filtered(numerator, denominator, values, axis))


def halton_sequence(axes: int, seed: int) -> Any:
    """Return the generator ``scipy.stats.qmc.Halton``, scrambled."""
    from scipy.stats import qmc

    return qmc.Halton(axes, seed=seed)


def chi2_quantile(level: float, freedom: int) -> float:
    """Return what χ² of ``freedom`` stays below with probability ``level``, 0 < level < 1."""
    return float(2.0 * gammaincinv(freedom / 2.0, level))
