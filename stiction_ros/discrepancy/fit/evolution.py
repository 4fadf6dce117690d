"""Many points that move on together over a likelihood of many narrow peaks: differential evolution.

A law that slips has a likelihood of steps and needles: no slope leads to the best one, and the
first good one is seldom it. Every point of a crowd moves along the difference of two others
(Storn and Price, 1997), so that the crowd takes on the shape of what is left of it, a narrow valley
across all axes too; a point gives way to a better one of its own alone, so that no good one
gathers all others before they have been where they lead.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stiction_ros.effects import FloatArray

FARTHEST = 1.2  # times the difference of two points, by which another one moves


def evolved(
    loss: Callable[[FloatArray], FloatArray],
    begun: FloatArray,
    ends: FloatArray,
    size: int,
    rounds: int,
) -> tuple[FloatArray, FloatArray]:
    """Return a crowd of points and their losses.

    Args:
        loss: of points of shape (G, axes).
        begun: points to begin with, shape (K, axes); the best of them are the crowd.
        ends: of every axis, shape (axes, 2).
        size: of the crowd.
        rounds: in each of which every point tries to move.
    """
    random = np.random.default_rng(0)
    losses = loss(begun)
    first = np.argsort(losses, kind="stable")[:size]
    points, losses = begun[first], losses[first]
    low, high = ends.T
    for k in range(rounds):
        count = len(points)
        one, other = (points[random.integers(0, count, count)] for _ in range(2))
        far = FARTHEST * random.random((count, 1))
        tried = points + far * (one - other)
        if k % 2:  # towards a better one
            order = np.argsort(losses, kind="stable")
            rank = np.empty(count, dtype=int)
            rank[order] = np.arange(count)
            better = points[order[random.integers(0, rank + 1)]]
            tried = points + far * (better - points + 0.5 * (one - other))
        tried = np.clip(tried, low, high)
        found = loss(tried)
        better_now = found < losses
        points = np.where(better_now[:, None], tried, points)
        losses = np.where(better_now, found, losses)
    return points, losses
