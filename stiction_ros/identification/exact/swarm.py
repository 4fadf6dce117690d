"""Rows (f_S, f_D, start) at random round a friction, on many scales.

For a law that remembers all its slips, such as the semi-physical one: a small error of f_D or of
the stem's start is carried on from slip to slip, so a needle of frictions fits, which a grid
misses. Slips that alternate cannot tell f_S from the start: with δ more of one and δ less of the
other the pattern is the same but for 1 % a slip. So rows change along f_S + start, f_D and
f_S − start, most widely along the last. Random numbers have a fixed seed.
"""

from __future__ import annotations

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.problem.models import Model

SEED = 20
ROWS = 3000
WIDTH, WIDE = 0.03, 0.1  # of the limit
DECADES = 6.0


def swarm_round(model: Model, valve: int, limit: float) -> FloatArray:
    """Return rows (f_S, f_D, start) at random round the model's, on six decades of scale, %."""
    generator = np.random.default_rng(SEED)
    centre = np.append(model.friction[valve], model.start[valve])
    rows = centre + limit * _offsets(generator)
    return _in_triangle(rows, limit)


def _offsets(generator: np.random.Generator) -> FloatArray:
    """Return random moves of (f_S, f_D, start), shape (ROWS, 3), as shares of the limit.

    Their scales differ by row and by direction.
    """
    scale = 10.0 ** generator.uniform(-DECADES, 0.0, (3, ROWS))
    used = generator.random((3, ROWS)) < 0.7
    off = generator.standard_normal((3, ROWS)) * scale * used
    total, dynamic, difference = off * np.array([[WIDTH], [WIDTH], [WIDE]])
    return np.column_stack([0.5 * (total + difference), dynamic, 0.5 * (total - difference)])


def _in_triangle(rows: FloatArray, limit: float) -> FloatArray:
    static = np.clip(rows[:, 0], 1e-9 * limit, limit)
    return np.column_stack(
        [static, np.clip(rows[:, 1], 0.0, static), np.clip(rows[:, 2], -static, static)]
    )
