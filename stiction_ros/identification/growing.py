"""Frictions where the right one is a needle: the record is taken in piece by piece.

Where noise is small and slips are many, a friction a little off slips once too early or too late,
and fits no better than one far away: no grid of a bearable size meets the right one. Over the
first few turns of OP it is a wide valley. So the whole triangle is looked at there; the best,
and what lies round them at ever smaller steps, are held against ever longer beginnings.
"""

from collections.abc import Callable

import numpy as np

from stiction_ros.effects import FloatArray, HeStiction
from stiction_ros.identification.friction import Judge, even_grid, with_beginnings
from stiction_ros.identification.kernels.scan import rows_apart

TURN = 0.1  # of the largest friction: less is no turn of OP
TURNS = 6  # of OP in the first beginning
LEAST = 100  # rows of it
PART, MOST = 16, 3  # of the rows: no less than a sixteenth, no more than a third
GROWTH = 1.5  # of a beginning to the next
SHRINK = 2.0  # of the steps
FINEST = 2e-3  # of the largest friction: last step, of the whole record
STEPS = 30  # of the first grid, along J and S
AWAY = 2  # rows of the first grid of which one is tried with other beginnings of the stem
KEPT, LAST = 60, 12  # frictions that go on, of a beginning and of the whole record
NEAR = [(j, s, 0) for j in (-1, 0, 1) for s in (-1, 0, 1)]
AROUND = np.array([*NEAR, (2, 0, 0), (-2, 0, 0), (0, 2, 0), (0, -2, 0), (0, 0, 2), (0, 0, -2)])
"""Steps along J = f_S − f_D, along S = f_S + f_D and of where the stem begins, to what is tried
round a friction."""


def grown(
    judged: Callable[[int], Judge], rows: int, first: int, limit: float, fineness: int = 1
) -> tuple[FloatArray, FloatArray]:
    """Return what was held against the whole record, and its loss.

    Args:
        judged: what judges rows (f_S, f_D, start) by a beginning of so many rows of the record.
        rows: of the record.
        first: of them in the first beginning.
        limit: largest f_S.
        fineness: of the first grid, of what goes on and of growth; more where judging costs little.

    Returns:
        Rows (f_S, f_D, start), shape (G, 3), and losses, shape (G,).
    """
    steps, growth = STEPS * fineness, GROWTH ** (1.0 / fineness)
    step, count = limit / steps, min(first, rows)
    grid = even_grid(limit, steps)
    tried = with_beginnings(grid, grid[::AWAY])
    over: list[FloatArray] = []
    while True:
        whole = count == rows
        found = judged(count)(tried)
        best = rows_apart(tried[:, :2], found, LAST if whole else KEPT * fineness, 0.5 * step)
        if whole:
            over.append(np.column_stack([tried, found]))
        if not best or (whole and step < FINEST * limit):
            break
        count, step = min(int(count * growth) + 1, rows), step / SHRINK
        tried = _round(tried[best], step, limit)
    found = np.vstack(over) if over else np.empty((0, 4))
    return found[:, :3], found[:, 3]


def _round(rows: FloatArray, step: float, limit: float) -> FloatArray:
    """Return rows (f_S, f_D, start) and their neighbours, kept inside the triangle."""
    jump, band, start = step * AROUND.T
    offsets = np.column_stack([0.5 * (band + jump), 0.5 * (band - jump), start])
    near = (rows[:, None, :] + offsets[None]).reshape(-1, 3)
    static = np.clip(near[:, 0], step * 1e-3, limit)
    dynamic = np.clip(near[:, 1], 0.0, static)
    return np.column_stack([static, dynamic, np.clip(near[:, 2], -static, static)])


def first_beginning(op: FloatArray, limit: float, rate: int = 1, least: int = LEAST) -> int:
    """Return the rows of the first beginning: those of the first turns of OP, in bounds.

    Args:
        op: shape (N,).
        limit: largest f_S, unit of OP.
        rate: samples of OP a row.
        least: rows, at least.
    """
    band, rows = TURN * limit, len(op) // rate
    moves = np.diff(HeStiction.simulate_grid(np.array([[band, band]]), op, float(op[0]))[:, 0])
    at = np.flatnonzero(moves)
    turns = at[1:][np.sign(moves[at[1:]]) != np.sign(moves[at[:-1]])]
    turned = int(turns[TURNS - 1]) // rate + 1 if len(turns) >= TURNS else rows
    return max(min(turned, rows // MOST), least, rows // PART)
