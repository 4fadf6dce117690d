"""SE at every delay: a small least-squares problem for each, compiled."""

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray

DEPENDENT = 1e-13
RIDGE = 1e-12
SAME = 1e-9


@compiled
def left_over(products: FloatArray, right: FloatArray, rest: float, out: FloatArray) -> None:
    """Write SE at every delay, shape (T,): the rest's energy less bᵀ M⁻¹ b.

    M holds the lagged products of the lags from the delay on, b those with the rest. What the
    projected columns leave nothing of is rounding and explains nothing, and so does what
    explains more than all.

    Args:
        products: row d those of lags that are d apart, shape (width, L).
        right: products with the rest, shape (L,).
        rest: sum of squares of the rest.
    """
    width = len(products)
    matrix, vector = np.empty((width, width)), np.empty(width)
    for t in range(len(out)):
        usable, used = True, 0.0
        for i in range(width):
            usable = usable and products[0, t + i] > 0.0
            vector[i] = right[t + i]
            for j in range(i):
                matrix[i, j] = products[i - j, t + j]
            matrix[i, i] = (1.0 + RIDGE * (1.0 + i)) * products[0, t + i]
        for i in range(width):
            if matrix[i, i] > DEPENDENT * products[0, t + i]:
                inverse, own = 1.0 / matrix[i, i], vector[i]
                used += own * (own * inverse)
                for j in range(i + 1, width):
                    factor = matrix[j, i] * inverse
                    vector[j] -= factor * own
                    for below in range(i + 1, j + 1):
                        matrix[j, below] -= factor * matrix[below, i]
        if not usable or used > rest * (1.0 + SAME):
            used = 0.0
        out[t] = max(rest - used, 1e-12 * rest)
