"""Seeds where the right friction is a needle: the record is taken in piece by piece.

Where noise is small and slips are many, a friction a little off slips once too early or too late,
and fits no better than one far away: no grid of a bearable size meets the right one. Over the
first few turns of OP it is a wide valley. So the whole triangle is looked at there; the best,
and what lies round them at ever smaller steps, are held against ever longer beginnings.
"""

from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.evidence.candidate import Candidate, Judge, rows_apart
from stiction_ros.identification.evidence.fit_problem import LIMIT, Problem
from stiction_ros.identification.evidence.output_fit import OutputFit
from stiction_ros.identification.friction import TURN, even_grid, samples_of_turns, with_beginnings

TURNS = 6  # of OP in the first beginning
LEAST = 100  # rows of it
PART, MOST = 16, 3  # of the rows: no less than a sixteenth, no more than a third
GROWTH = 1.5  # of a beginning to the next
SHRINK = 2.0  # of the steps
FINEST = 2e-3  # of the span of OP: last step, of the whole record
STEPS = 30  # of the first grid, along J and S
AWAY = 2  # rows of the first grid of which one is tried with other beginnings of the stem
KEPT, LAST = 60, 12  # frictions that go on, of a beginning and of the whole record
NEAR = [(j, s, 0) for j in (-1, 0, 1) for s in (-1, 0, 1)]
AROUND = np.array([*NEAR, (2, 0, 0), (-2, 0, 0), (0, 2, 0), (0, -2, 0), (0, 0, 2), (0, 0, -2)])
"""Steps along J = f_S − f_D, along S = f_S + f_D and of where the stem begins, to what is tried
round a friction."""


def grown(
    problem: Problem, base: Candidate, valve: int, fits: Sequence[OutputFit]
) -> tuple[FloatArray, FloatArray]:
    """Return what was held against the whole record, and its loss.

    Args:
        problem: the record.
        base: whose other valves are kept.
        valve: index.
        fits: whose noise and prior are taken.

    Returns:
        Rows (f_S, f_D, start), shape (G, 3), and losses, shape (G,).
    """
    step, count = LIMIT / STEPS, min(_first(problem, valve), problem.rows)
    grid = even_grid(LIMIT, STEPS)
    tried = with_beginnings(grid, grid[::AWAY])
    over: list[FloatArray] = []
    while True:
        part, whole = problem.beginning(count), count == problem.rows
        found = Judge.of(part, base.beginning(count), valve, fits).losses(tried)
        best = rows_apart(tried[:, :2], found, LAST if whole else KEPT, 0.5 * step)
        if whole:
            over.append(np.column_stack([tried, found]))
        if not best or (whole and step < FINEST):
            break
        count, step = min(int(count * GROWTH) + 1, problem.rows), step / SHRINK
        tried = _round(tried[best], step)
    judged = np.vstack(over) if over else np.empty((0, 4))
    return judged[:, :3], judged[:, 3]


def _round(rows: FloatArray, step: float) -> FloatArray:
    """Return rows (f_S, f_D, start) and their neighbours, kept inside the triangle."""
    jump, band, start = step * AROUND.T
    offsets = np.column_stack([0.5 * (band + jump), 0.5 * (band - jump), start])
    near = (rows[:, None, :] + offsets[None]).reshape(-1, 3)
    static = np.clip(near[:, 0], step * 1e-3, LIMIT)
    dynamic = np.clip(near[:, 1], 0.0, static)
    return np.column_stack([static, dynamic, np.clip(near[:, 2], -static, static)])


def _first(problem: Problem, valve: int) -> int:
    """Return the rows of the first beginning."""
    samples = samples_of_turns(problem.op[valve], TURN, TURNS)
    rows = problem.rows if samples is None else (samples - 1) // problem.rate + 1
    return max(min(rows, problem.rows // MOST), LEAST, problem.rows // PART)
