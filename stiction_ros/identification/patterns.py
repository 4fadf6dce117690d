r"""Every switching pattern of a valve inside a rectangle of frictions.

Under He's law the stem is, after its first slip, :math:`\chi = u_s - \sigma f_D`, with the
sample s and the direction σ of the last slip, and (4) becomes two comparisons: the valve slips
on in the same direction when :math:`\sigma (u_k - u_s) > J` and back when
:math:`-\sigma (u_k - u_s) > S`, with J = f_S − f_D and S = f_S + f_D.
So the frictions with one and the same pattern of slips fill a
rectangle in the plane of (J, S), a *cell*, and the cells tile the plane. Inside a cell u_s and σ
are fixed and the stem is affine in f_D. Cells are listed one after another until nothing of
the rectangle is left: an exact enumeration, without a step size.

The laws with a moving state have such cells as well (:mod:`.moving_patterns`).

What happens before the first slip depends on the unknown stem position at the start. A valve
starts either at a given level, and then slips as (4) says, or its first slip is given.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects import FrictionLaw, HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.moving_patterns import RULES

SWARM = 2
FEW = 40


@dataclasses.dataclass(frozen=True)
class Beginning:
    """The stem before and at its first slip.

    Attributes:
        level: stem position before the first slip, %.
        first: sample of the first slip; the length of the record when there is none.
        direction: +1 or −1, of the first slip; 0 when there is none.
    """

    level: float
    first: int
    direction: float


@dataclasses.dataclass(frozen=True)
class Cells:
    """Cells of the (J, S) plane and their stems base − f_D · sign.

    Attributes:
        bounds: rows (J low, J high, S low, S high), %, shape (G, 4).
        bases: u at the last slip, before the first slip the stem's level, shape (G, N).
        signs: direction of the last slip, 0 before the first, shape (G, N).
    """

    bounds: FloatArray
    bases: FloatArray
    signs: FloatArray

    @property
    def dynamic(self) -> FloatArray:
        """Ranges of f_D = (S − J) / 2 inside the cells, shape (G, 2)."""
        low = 0.5 * (self.bounds[:, 2] - self.bounds[:, 1])
        high = 0.5 * (self.bounds[:, 3] - self.bounds[:, 0])
        return np.stack([np.maximum(low, 0.0), high], axis=1)

    def part(self, rows: slice) -> Cells:
        """Return some of the cells."""
        return Cells(self.bounds[rows], self.bases[rows], self.signs[rows])


def has_cells(law: type[FrictionLaw]) -> bool:
    """Return whether the switching patterns of a law can be enumerated."""
    return law is HeStiction or law in RULES


def beginning_of(
    u: FloatArray, level: float, static: float, law: type[FrictionLaw] = HeStiction
) -> Beginning:
    """Return the beginning of a valve that rests at ``level`` with static friction f_S."""
    if law in RULES:
        return Beginning(level, *RULES[law](u).first_slip(level, static))
    error = u - level
    slips = np.flatnonzero(np.abs(error) > static)
    if not len(slips):
        return Beginning(level, len(u), 0.0)
    return Beginning(level, int(slips[0]), float(np.sign(error[slips[0]])))


def first_slip_range(
    u: FloatArray, level: float, begin: Beginning, law: type[FrictionLaw] = HeStiction
) -> tuple[float, float]:
    """Return the f_S, %, with which a valve that rests at ``level`` first slips as it did."""
    if law in RULES:
        may = RULES[law](u).resting_samples(level)
        lead = np.where(may, np.abs(u - level), 0.0)
        return float(lead[: begin.first].max(initial=0.0)), float(lead[begin.first])
    least = float(np.abs(u[: begin.first] - level).max(initial=0.0))
    return least, float(begin.direction * (u[begin.first] - level))


def levels_of(
    u: FloatArray, static: float, most: int, law: type[FrictionLaw] = HeStiction
) -> FloatArray:
    """Return ranges of the level before the first sample, one per first slip, shape (G, 2).

    The ranges tile u_0 ± f_S; inside each the first slip is the same. When there are more
    than ``most``, the widest are returned.
    """
    if law in RULES:
        may = RULES[law](u).resting_samples(float(u[0]))
        u = u[may] if may.any() else u
    edges = [float(u[0]) - static, float(u[0]) + static]
    highs = np.unique(np.maximum.accumulate(u)) - static
    lows = np.unique(np.minimum.accumulate(u)) + static
    inside = np.concatenate([highs, lows])
    inside = inside[(inside > edges[0]) & (inside < edges[1])]
    ends = np.unique(np.concatenate([edges, inside]))
    widest = np.argsort(ends[:-1] - ends[1:], kind="stable")[:most]
    return np.column_stack([ends[:-1], ends[1:]])[widest]


def cells_at(
    u: FloatArray, begin: Beginning, points: FloatArray, law: type[FrictionLaw] = HeStiction
) -> Cells:
    """Return the cells that hold the points (J, S), shape (G, 2), behind a given first slip."""
    if law in RULES:
        first = (begin.first, begin.direction)
        return _moving_cells(u, points, np.full(len(points), begin.level), law, first)
    base = np.full(len(points), begin.level)
    sign = np.zeros(len(points))
    return _cells(u, points, base, sign, begin)


def resting_cells(
    u: FloatArray, levels: FloatArray, points: FloatArray, law: type[FrictionLaw] = HeStiction
) -> Cells:
    """Return the cells of the points (J, S), shape (G, 2), of valves that rest at ``levels``.

    The f_S at which the first slip would change is not among their bounds.

    Args:
        levels: stem position before the first sample, %, shape (G,).
    """
    if law in RULES:
        return _moving_cells(u, points, levels, law, None)
    return _cells(u, points, levels.copy(), np.zeros(len(points)), None)


def _moving_cells(
    u: FloatArray,
    points: FloatArray,
    levels: FloatArray,
    law: type[FrictionLaw],
    first: tuple[int, float] | None,
) -> Cells:
    rules = RULES[law](u)
    traces = [
        rules.trace(point, level, first)
        for point, level in zip(points.tolist(), levels.tolist(), strict=True)
    ]
    return Cells(
        np.array([trace.bounds for trace in traces]).reshape(-1, 4),
        np.array([trace.base for trace in traces]).reshape(-1, len(u)),
        np.array([trace.sign for trace in traces]).reshape(-1, len(u)),
    )


def _cells(
    u: FloatArray, points: FloatArray, base: FloatArray, sign: FloatArray, begin: Beginning | None
) -> Cells:
    bases, signs = _simulate(u, points, base, sign, begin)
    return Cells(_bounds(u, bases, signs), bases, signs)


def _simulate(
    u: FloatArray, points: FloatArray, base: FloatArray, sign: FloatArray, begin: Beginning | None
) -> tuple[FloatArray, FloatArray]:
    """Return u at the last slip and its direction, both of shape (G, N)."""
    if len(points) <= FEW:
        rows = [
            _simulate_one(u, float(point[0]), float(point[1]), level, begin)
            for point, level in zip(points, base.tolist(), strict=True)
        ]
        return np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    jump, reverse = np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1])
    values, bases, signs, begins = u.tolist(), [base], [sign], [0]
    after = 0
    if begin is not None:
        after = begin.first + 1
        if begin.first < len(u):
            base, sign = np.full_like(base, u[begin.first]), np.full_like(sign, begin.direction)
            bases.append(base)
            signs.append(sign)
            begins.append(begin.first)
    high, low = _thresholds(base, sign, jump, reverse)
    ceiling, floor = high.min(), low.max()
    busy = 0
    for k in range(after, len(values)):
        value = values[k]
        if not busy and floor <= value <= ceiling:
            continue
        up, down = value > high, value < low
        base = np.where(up | down, value, base)
        sign = np.where(up, 1.0, np.where(down, -1.0, sign))
        bases.append(base)
        signs.append(sign)
        begins.append(k)
        high, low = _thresholds(base, sign, jump, reverse)
        busy = busy - 1 if busy else SWARM  # slips come in swarms
        if not busy:
            ceiling, floor = high.min(), low.max()
    lengths = np.diff([*begins, len(values)])
    return (
        np.repeat(np.stack(bases, axis=1), lengths, axis=1),
        np.repeat(np.stack(signs, axis=1), lengths, axis=1),
    )


def _simulate_one(
    u: FloatArray, jump: float, reverse: float, level: float, begin: Beginning | None
) -> tuple[FloatArray, FloatArray]:
    values, bases, signs, begins = u.tolist(), [level], [0.0], [0]
    after = 0
    half = 0.5 * (jump + reverse)
    high, low = level + half, level - half
    if begin is not None:
        after = begin.first + 1
        if begin.first < len(u):
            bases.append(values[begin.first])
            signs.append(begin.direction)
            begins.append(begin.first)
            high, low = _edges(bases[-1], signs[-1], jump, reverse)
    for k in range(after, len(values)):
        value = values[k]
        if low <= value <= high:
            continue
        bases.append(value)
        signs.append(1.0 if value > high else -1.0)
        begins.append(k)
        high, low = _edges(value, signs[-1], jump, reverse)
    lengths = np.diff([*begins, len(values)])
    return np.repeat(bases, lengths), np.repeat(signs, lengths)


def _edges(base: float, sign: float, jump: float, reverse: float) -> tuple[float, float]:
    return (base + jump, base - reverse) if sign > 0.0 else (base + reverse, base - jump)


def _thresholds(
    base: FloatArray, sign: FloatArray, jump: FloatArray, reverse: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return OP above and below which the stems slip; f_S before the first slip."""
    half = 0.5 * (jump + reverse)
    up = np.where(sign > 0.0, jump, np.where(sign < 0.0, reverse, half))
    down = np.where(sign > 0.0, reverse, np.where(sign < 0.0, jump, half))
    return base + up, base - down


def _bounds(u: FloatArray, bases: FloatArray, signs: FloatArray) -> FloatArray:
    """Return per pattern what its stays and slips say of J and S."""
    out = np.empty((len(bases), 4))
    lead = signs[:, :-1] * (u[None, 1:] - bases[:, :-1])
    slips = bases[:, 1:] != bases[:, :-1]
    stayed = np.where(slips, 0.0, lead)
    out[:, 0] = np.maximum(stayed.max(axis=1), 0.0)
    out[:, 2] = np.maximum(-stayed.min(axis=1), 0.0)
    out[:, 1] = np.where(slips & (lead > 0.0), lead, np.inf).min(axis=1)
    out[:, 3] = np.where(slips & (lead < 0.0), -lead, np.inf).min(axis=1)
    return out
