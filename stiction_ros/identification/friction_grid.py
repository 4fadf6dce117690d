"""Grids over the friction triangle 0 ≤ f_D ≤ f_S ≤ limit, and what one simulation reveals."""

from __future__ import annotations

import numpy as np

from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray, SimulatesGrid
from stiction_ros.errors import InputError

LAWS: dict[str, type[SimulatesGrid]] = {"he": HeStiction}


def find_law(name: str) -> type[SimulatesGrid]:
    """Return the friction law called ``name`` that simulates whole grids.

    Raises:
        InputError: no such law.
    """
    if name not in LAWS:
        raise InputError(
            f"unknown friction law {name!r}", where="law", fix=f"known laws: {', '.join(LAWS)}"
        )
    return LAWS[name]


def triangle(limit: float, steps: int, first: int = 1) -> FloatArray:
    """Return an even triangular grid of rows (f_S, f_D), f_S from ``first`` steps to ``limit``."""
    nodes = np.arange(steps + 1) * (limit / steps)
    rows = [(nodes[i], nodes[j]) for i in range(first, steps + 1) for j in range(i + 1)]
    return np.array(rows, dtype=float)


def coarse_grid(limit: float) -> FloatArray:
    """Return the first grid: 20 steps over the whole triangle, finer towards small friction."""
    fine = [triangle(limit / 4.0, 14), triangle(limit / 20.0, 8), triangle(limit / 100.0, 4)]
    return np.unique(np.vstack([triangle(limit, 20), *fine]).round(12), axis=0)


def around(centres: FloatArray, step: float, limit: float, half: int = 3) -> FloatArray:
    """Return local grids of (2·half + 1)² rows round each centre, kept inside the triangle."""
    offsets = np.arange(-half, half + 1) * step
    mesh = np.stack(np.meshgrid(offsets, offsets, indexing="ij"), axis=-1).reshape(-1, 2)
    rows = (centres[:, None, :] + mesh[None]).reshape(-1, 2)
    static = np.clip(rows[:, 0], 0.0, limit)
    dynamic = np.clip(rows[:, 1], 0.0, static)
    grid = np.unique(np.column_stack([static, dynamic]).round(12), axis=0)
    return np.asarray(grid[grid[:, 0] > 0.0])


def simulate(
    law: type[SimulatesGrid], grid: FloatArray, u: FloatArray, start: FloatArray | float
) -> FloatArray:
    """Return stems, shape (G, N), contiguous, for rows (f_S, f_D) and OP u, shape (N,)."""
    return np.ascontiguousarray(law.simulate_grid(grid, u, start).T)


def switching_bounds(
    stems: FloatArray, u: FloatArray, start: FloatArray, static: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return largest |e| at which each stem stayed and smallest |e| at which it slipped.

    He's pattern, and so the whole simulation, is the same for every f_S between the two.

    Args:
        stems: shape (G, N), simulated with ``start`` and ``static``, shape (G,).
        u: OP, shape (N,).
    """
    before = np.concatenate([start[:, None], stems[:, :-1]], axis=1)
    error = np.abs(u[None, :] - before)
    slips = error > static[:, None]
    stayed = np.where(slips, 0.0, error).max(axis=1)
    slipped = np.where(slips, error, np.inf).min(axis=1)
    return stayed, slipped


def count_moves(stems: FloatArray) -> FloatArray:
    """Return how often each stem moved, shape (G,)."""
    return np.asarray((np.diff(stems, axis=1) != 0.0).sum(axis=1), dtype=float)
