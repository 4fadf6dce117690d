"""Where the nonlinear programme starts: border of the triangle and the line f_S + f_D = S_0."""

from __future__ import annotations

import dataclasses
import enum

import numpy as np

from stiction_ros.effects.behaviour import FloatArray

STEP = 0.5
MAX_LINE = 3


class StartKind(enum.StrEnum):
    """Where a start comes from."""

    BORDER = "border"
    ELLIPSE = "ellipse"
    RESTART = "restart"
    DELAY = "delay"


@dataclasses.dataclass(frozen=True)
class Start:
    """A first guess of the frictions.

    Attributes:
        kind: where it comes from.
        friction: rows (f_S, f_D), shape (m, 2), %.
    """

    kind: StartKind
    friction: FloatArray


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


def draw_starts(limits: FloatArray, stictions: FloatArray, count: int) -> tuple[Start, ...]:
    """Return M starts for all valves at once.

    Up to three (and no more than half) lie on the line of S_0, the others evenly on the
    border. With several valves, valve j takes the list moved on by j, so that the valves do
    not all start at the same kind of point. A valve without an ellipse (S_0 = 0) starts
    on the border only.

    Args:
        limits: f_max per valve, shape (m,), %.
        stictions: S_0 per valve, shape (m,), %; 0 where no ellipse was found.
        count: M ≥ 1.
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
