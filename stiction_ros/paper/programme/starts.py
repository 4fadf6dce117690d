"""Where the nonlinear programme starts: border and line f_S + f_D = S_0 as printed, and inside."""

import dataclasses
import enum

import numpy as np

from stiction_ros.effects.behaviour import FloatArray

STEP = 0.5
MAX_LINE = 3
LINE_POINTS = 20
# Inverse powers of the plastic number: multiples of them cover the square evenly.
EVEN = np.array([0.7548776662466927, 0.5698402909980532])


class StartKind(enum.StrEnum):
    """Where a start comes from."""

    BORDER = "border"
    ELLIPSE = "ellipse"
    INSIDE = "inside"
    RESTART = "restart"
    DELAY = "delay"


@dataclasses.dataclass(frozen=True)
class Start:
    """A first guess of the frictions."""

    kind: StartKind  # where it comes from
    friction: FloatArray  # rows (f_S, f_D), shape (m, 2), %


def border(limit: float, step: float = STEP) -> FloatArray:
    """Return the border of 0 ≤ f_D ≤ f_S ≤ limit in steps, shape (n, 2), %.

    From (0, 0) along f_D = 0 to (limit, 0), up to (limit, limit), and back along f_D = f_S.
    A triangle smaller than four steps is walked in quarters of its side.
    """
    step = min(step, limit / 4.0)
    nodes = np.append(np.arange(0.0, limit - 1e-9 * limit, step), limit)
    rows = [(value, 0.0) for value in nodes]
    rows += [(limit, value) for value in nodes[1:]]
    rows += [(value, value) for value in nodes[-2:0:-1]]
    return np.array(rows)


def stiction_line(stiction: float, limit: float, count: int) -> FloatArray:
    """Return ``count`` points with f_S + f_D = S_0, shape (count, 2), %.

    Evenly over S_0 / 2 ≤ f_S ≤ S_0, ends left out, and cut off at ``limit``.
    """
    share = (np.arange(count) + 0.5) / max(count, 1)
    static = np.minimum(0.5 * stiction * (1.0 + share), limit)
    return np.column_stack([static, np.clip(stiction - static, 0.0, static)])


def inside(limit: float, count: int) -> FloatArray:
    """Return ``count`` points, none of them round, over the triangle, shape (count, 2), %."""
    square = (0.5 + np.arange(1, count + 1)[:, None] * EVEN) % 1.0
    return limit * np.column_stack([square.max(axis=1), square.min(axis=1)])


def around(friction: FloatArray, limits: FloatArray, reach: float, count: int) -> list[FloatArray]:
    """Return up to ``count`` points about each valve's friction, others held, (m, 2) each.

    J = f_S − f_D and f_S + f_D go as far as ``reach``, a share of f_max.
    """
    found = []
    moves = 2.0 * ((0.5 + np.arange(1, count + 1)[:, None] * EVEN) % 1.0) - 1.0
    for j, limit in enumerate(limits.tolist()):
        for jump, band in (reach * limit * moves).tolist():
            static = float(friction[j, 0]) + 0.5 * (band + jump)
            dynamic = float(friction[j, 1]) + 0.5 * (band - jump)
            if 0.0 <= dynamic <= static <= limit:
                moved = friction.copy()
                moved[j] = static, dynamic
                found.append(moved)
    return found


def draw_starts(limits: FloatArray, stictions: FloatArray, count: int) -> tuple[Start, ...]:
    """Return M starts for all valves at once, as printed.

    Up to three (and no more than half) lie on the line of S_0, the others evenly on the
    border. With several valves, valve j takes the list moved on by j, so that the valves do
    not all start at the same kind of point. A valve without an ellipse (S_0 = 0) starts
    on the border only.
    """
    on_line = min(MAX_LINE, count // 2)
    rows, kinds = [], []
    for j, (limit, stiction) in enumerate(zip(limits.tolist(), stictions.tolist(), strict=True)):
        lined = on_line if stiction > 0.0 else 0
        edge = border(limit)
        chosen = edge[(np.arange(count - lined) * len(edge)) // max(count - lined, 1)]
        points = np.vstack([stiction_line(stiction, limit, lined), chosen])
        named = [StartKind.ELLIPSE] * lined + [StartKind.BORDER] * (count - lined)
        rows.append(np.roll(points, -j, axis=0))
        kinds.append(named[j % count :] + named[: j % count])
    return tuple(Start(kinds[0][k], np.array([part[k] for part in rows])) for k in range(count))


def candidates(limits: FloatArray, stictions: FloatArray, count: int) -> tuple[Start, ...]:
    """Return points to choose starts from: one valve has friction, the others have none.

    S_0, %, is 0 without an ellipse; ``count`` points lie inside the widest triangle, as many
    for their area in the others.
    """
    found = [Start(StartKind.BORDER, np.zeros((len(limits), 2)))]
    for j, (limit, stiction) in enumerate(zip(limits.tolist(), stictions.tolist(), strict=True)):
        share = max(1, round(count * (limit / float(limits.max())) ** 2))
        parts = [(StartKind.BORDER, border(limit)[1:]), (StartKind.INSIDE, inside(limit, share))]
        if stiction > 0.0:
            parts.append((StartKind.ELLIPSE, stiction_line(stiction, limit, LINE_POINTS)))
        for kind, points in parts:
            for point in points:
                friction = np.zeros((len(limits), 2))
                friction[j] = point
                found.append(Start(kind, friction))
    return tuple(found)
