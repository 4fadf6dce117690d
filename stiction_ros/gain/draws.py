"""Loops that the identification does not tell apart: friction and controller drawn anew."""

from __future__ import annotations

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.closed_loop.recovered_controller import RecoveredController
from stiction_ros.identification.result.identification import ValveEstimate

DRAWS = 20
"""Loops drawn, the estimate itself among them."""

SEED = 18
"""Of the draws: the same record gives the same answer."""

LEAST_SHARE = 0.2
"""Share of a coefficient that a draw keeps at least: gain and reset keep their sign."""


def drawn_frictions(valve: ValveEstimate, count: int, random: np.random.Generator) -> FloatArray:
    """Return (f_S, f_D), %, shape (count, 2).

    The estimate, then both ends of the intervals, then pairs drawn evenly from them.
    """
    pairs = np.empty((count, 2))
    pairs[:, 0] = random.uniform(*_ends(valve.static_interval), count)
    pairs[:, 1] = random.uniform(*_ends(valve.dynamic_interval), count)
    pairs[0] = valve.static_friction, valve.dynamic_friction
    for end in range(min(count - 1, 2)):
        pairs[1 + end] = _ends(valve.static_interval)[end], _ends(valve.dynamic_interval)[end]
    pairs[:, 1] = np.minimum(pairs[:, 1], pairs[:, 0])
    return pairs


def drawn_tunings(law: RecoveredController, count: int, random: np.random.Generator) -> FloatArray:
    """Return (K, K_i, K_d), shape (count, 3): as recovered, then with its covariance."""
    values, vectors = np.linalg.eigh(law.covariance)
    spread = vectors * np.sqrt(np.maximum(values, 0.0))
    found = law.coefficients + random.standard_normal((count, 3)) @ spread.T
    found[0] = law.coefficients
    for k in range(2):
        kept = LEAST_SHARE * law.coefficients[k]
        weak = found[:, k] * law.coefficients[k] < kept * law.coefficients[k]
        found[weak, k] = kept
    return np.asarray(found)


def _ends(interval: tuple[float, float]) -> tuple[float, float]:
    low, high = interval
    return max(low, 0.0), max(high, low, 0.0)
