r"""Every switching pattern of a valve inside a rectangle of frictions.

Under He's law the stem is, after its first slip, :math:`\chi = u_s - \sigma f_D`, with the
sample s and the direction σ of the last slip, and (4) becomes two comparisons: the valve slips
on in the same direction when :math:`\sigma (u_k - u_s) > J` and back when
:math:`-\sigma (u_k - u_s) > S`, with J = f_S − f_D and S = f_S + f_D.
So the frictions with one and the same pattern of slips fill a
rectangle in the plane of (J, S), a *cell*, and the cells tile the plane. Inside a cell u_s and σ
are fixed and the stem is affine in f_D. Cells are listed one after another until nothing of
the rectangle is left: an exact enumeration, without a step size.

The laws with a moving state have such cells as well
(:mod:`stiction_ros.effects.friction.moving_rules`).

What happens before the first slip depends on the unknown stem position at the start. A valve
starts either at a given level, and then slips as (4) says, or its first slip is given.
"""

import dataclasses
import math

import numpy as np

from stiction_ros.effects import FrictionLaw, HeStiction
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.effects.friction.moving_rules import MovingRules
from stiction_ros.errors import InputError
from stiction_ros.identification.friction import first_values, simulate
from stiction_ros.identification.kernels.step import he_pattern_steps, he_steps


@dataclasses.dataclass(frozen=True)
class StepSignals:
    """G signals of c channels each that are constant between few samples, as stems are.

    A valve is kept as the samples at which it changes and the values from there on. What costs time
    then grows with the moves, not with the samples.
    """

    count: int  # N, samples of every signal
    # rows ``offsets[g]`` to ``offsets[g + 1]`` belong to signal g, shape (G + 1,)
    offsets: IntArray
    # samples from which on a row holds; 0 in the first of every signal, shape (R,)
    places: IntArray
    values: FloatArray  # shape (R, c)

    @classmethod
    def of(cls, *channels: FloatArray) -> "StepSignals":
        """Return the signals of which ``channels``, shape (N, G) each, hold all samples."""
        count = len(channels[0])
        rows = np.ascontiguousarray(np.stack(channels).transpose(2, 0, 1), dtype=float)
        changed = np.ones((len(rows), count), dtype=bool)
        changed[:, 1:] = (rows[:, :, 1:] != rows[:, :, :-1]).any(axis=1)
        signals, places = np.nonzero(changed)
        offsets = np.append(0, np.cumsum(np.count_nonzero(changed, axis=1)))
        return cls(count, offsets, places, rows[signals, :, places])

    @classmethod
    def joined(cls, parts: "list[StepSignals]") -> "StepSignals":
        """Return all signals of several lists, at least one, of equal N and c."""
        offsets, total = [np.zeros(1, dtype=np.int64)], 0
        for part in parts:
            offsets.append(part.offsets[1:] + total)
            total += len(part.places)
        return cls(
            parts[0].count,
            np.concatenate(offsets),
            np.concatenate([part.places for part in parts]),
            np.concatenate([part.values for part in parts]),
        )

    def chosen(self, signals: IntArray) -> "StepSignals":
        """Return some of the signals, by their indices."""
        lengths = np.diff(self.offsets)[signals]
        offsets = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(lengths)])
        rows = np.arange(offsets[-1]) + np.repeat(self.offsets[signals] - offsets[:-1], lengths)
        return StepSignals(self.count, offsets, self.places[rows], self.values[rows])

    @property
    def size(self) -> int:
        """G, number of signals."""
        return len(self.offsets) - 1

    @property
    def moves(self) -> IntArray:
        """How often the first channel of each signal changes, shape (G,)."""
        if self.values.shape[1] == 1:  # every row but the first is a change
            return np.diff(self.offsets) - 1
        changed = np.zeros(len(self.places) + 1, dtype=np.int64)
        changed[1:-1] = self.values[1:, 0] != self.values[:-1, 0]
        changed[self.offsets] = 0
        return np.diff(np.cumsum(changed)[self.offsets])


def stem_steps(
    law: type[FrictionLaw], grid: FloatArray, u: FloatArray, start: FloatArray | float
) -> StepSignals:
    """Return stems for rows (f_S, f_D) and OP u, shape (N,), as :func:`simulate` does."""
    if law is not HeStiction:
        return StepSignals.of(simulate(law, grid, u, start))
    starts = np.broadcast_to(np.asarray(start, dtype=float), (len(grid),)).copy()
    static, dynamic = np.ascontiguousarray(grid[:, 0]), np.ascontiguousarray(grid[:, 1])
    return StepSignals(len(u), *he_steps(static, dynamic, u, starts))


@dataclasses.dataclass(frozen=True)
class PatternScan:
    """Evaluated cells."""

    bounds: FloatArray  # rows (J low, J high, S low, S high), %, shape (G, 4)
    dynamic: FloatArray  # range of f_D in the cell, shape (G, 2)
    level: FloatArray  # best f_D in the cell, shape (G,)
    curvature: FloatArray  # second derivative of the loss in f_D, shape (G,)
    loss: FloatArray  # n log(SE / n) at the best f_D and delays, summed over outputs, shape (G,)
    delays: FloatArray  # best delay per output, shape (G, p)
    moves: FloatArray  # number of stem moves, shape (G,)

    @staticmethod
    def joined(parts: "list[PatternScan]") -> "PatternScan":
        """Return all cells of several scans."""
        names = [field.name for field in dataclasses.fields(PatternScan)]
        return PatternScan(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))

    def chosen(self, cells: IntArray) -> "PatternScan":
        """Return some of the cells, by their indices."""
        names = [field.name for field in dataclasses.fields(PatternScan)]
        return PatternScan(*(getattr(self, name)[cells] for name in names))

    def static_range(self, index: int, dynamic: tuple[float, float]) -> tuple[float, float]:
        """Return the values of f_S in a cell for f_D in a range, %."""
        jl, jh, sl, sh = self.bounds[index].tolist()
        least, most = dynamic
        low = min(max(0.5 * (sl - jl), least), most)
        high = min(max(0.5 * (sh - jh), least), most) if math.isfinite(jh) else most
        return max(jl + low, sl - low, low), min(jh + high, sh - high)

    def middle(self, index: int, limit: float) -> tuple[float, float]:
        """Return f_S in the middle of a cell at its best f_D, and that f_D, %."""
        f_d = float(self.level[index])
        low, high = self.static_range(index, (f_d, f_d))
        return 0.5 * (low + min(high, limit)), f_d

    def accepted_dynamic(self, index: int, allowance: float) -> tuple[float, float]:
        """Return the values of f_D in a cell whose loss exceeds its best by ``allowance``."""
        curvature = max(float(self.curvature[index]), 1e-300)
        reach = float(np.sqrt(2.0 * max(allowance, 0.0) / curvature))
        low, high = self.dynamic[index]
        level = self.level[index]
        return float(max(low, level - reach)), float(min(high, level + reach))


@dataclasses.dataclass(frozen=True)
class Beginning:
    """The stem before and at its first slip."""

    level: float  # stem position before the first slip, %
    first: int  # sample of the first slip; the length of the record when there is none
    direction: float  # +1 or −1, of the first slip; 0 when there is none

    def slips_alike(self, other: "Beginning") -> bool:
        """Return whether another beginning has the same first slip, from whatever level."""
        return (self.first, self.direction) == (other.first, other.direction)


@dataclasses.dataclass(frozen=True)
class Cells:
    """Cells of the (J, S) plane and their stems base − f_D · sign."""

    bounds: FloatArray  # rows (J low, J high, S low, S high), %, shape (G, 4)
    steps: StepSignals  # base and sign as two channels

    @staticmethod
    def joined(parts: "list[Cells]") -> "Cells":
        """Return the cells of several lists, at least one."""
        if len(parts) == 1:
            return parts[0]
        steps = StepSignals.joined([part.steps for part in parts])
        return Cells(np.concatenate([part.bounds for part in parts]), steps)

    def distinct(self) -> "Cells":
        """Return every cell once; cells do not overlap, so their lower corners tell them."""
        corners = self.bounds[:, 0] + 1j * self.bounds[:, 2]
        _, first = np.unique(corners, return_index=True)
        return Cells(self.bounds[first], self.steps.chosen(first))

    @property
    def dynamic(self) -> FloatArray:
        """Ranges of f_D = (S − J) / 2 inside the cells, shape (G, 2)."""
        low = 0.5 * (self.bounds[:, 2] - self.bounds[:, 1])
        high = 0.5 * (self.bounds[:, 3] - self.bounds[:, 0])
        return np.stack([np.maximum(low, 0.0), high], axis=1)


def require_cells(law: type[FrictionLaw]) -> None:
    """Refuse a law whose switching patterns are not those of f_S and f_D alone.

    Raises:
        InputError: such a law.
    """
    if law.switching is None or first_values(law):
        raise InputError(
            f"the exact search cannot enumerate the switching patterns of law {law.law!r}",
            where="law",
            fix="use the method evidence, which identifies every law",
        )


def slip_rules(law: type[FrictionLaw], u: FloatArray) -> MovingRules:
    """Return how a valve leaves its rest under OP u, (N,); under He's law as under Kano's."""
    return law.switching(u) if isinstance(law.switching, type) else MovingRules(u)


def beginning_of(
    u: FloatArray, level: float, static: float, law: type[FrictionLaw] = HeStiction
) -> Beginning:
    """Return the beginning of a valve that rests at ``level`` with static friction f_S."""
    return Beginning(level, *slip_rules(law, u).first_slip(level, static))


def first_slip_range(
    u: FloatArray, level: float, begin: Beginning, law: type[FrictionLaw] = HeStiction
) -> tuple[float, float]:
    """Return the f_S, %, with which a valve that rests at ``level`` first slips as it did."""
    rules = slip_rules(law, u)
    lead = np.where(rules.resting_samples(level), np.abs(u - level), 0.0)
    so = rules.direction(begin.first, level) == begin.direction
    return float(lead[: begin.first].max(initial=0.0)), float(lead[begin.first]) if so else 0.0


def levels_of(
    u: FloatArray, static: float, most: int, law: type[FrictionLaw] = HeStiction
) -> FloatArray:
    """Return ranges of the level before the first sample, one per first slip, shape (G, 2).

    The ranges tile u_0 ± f_S; inside each the first slip is the same. When there are more
    than ``most``, the widest are returned.
    """
    may = slip_rules(law, u).resting_samples(float(u[0]))
    u = u[may] if may.any() else u
    edges = [float(u[0]) - static, float(u[0]) + static]
    highs = np.unique(np.maximum.accumulate(u)) - static
    lows = np.unique(np.minimum.accumulate(u)) + static
    inside = np.concatenate([highs, lows])
    inside = inside[(inside > edges[0]) & (inside < edges[1])]
    ends = np.unique(np.concatenate([edges, inside]))
    widest = np.argsort(ends[:-1] - ends[1:], kind="stable")[:most]
    return np.column_stack([ends[:-1], ends[1:]])[widest]


def levels_with(
    u: FloatArray, static: float, begin: Beginning, law: type[FrictionLaw] = HeStiction
) -> FloatArray:
    """Return the range of the level from which a valve with f_S first slips as in ``begin``.

    Returns:
        Shape (1, 2), or (0, 2) when there is no such level.
    """
    may = slip_rules(law, u).resting_samples(float(u[0]))[: begin.first]
    before = u[: begin.first][may]
    if not len(before):
        return np.empty((0, 2))
    low, high = float(before.max()) - static, float(before.min()) + static
    edge = float(u[begin.first]) - begin.direction * static
    low, high = (low, min(high, edge)) if begin.direction > 0.0 else (max(low, edge), high)
    return np.array([[low, high]]) if low < high else np.empty((0, 2))


def cells_at(
    u: FloatArray, begin: Beginning, points: FloatArray, law: type[FrictionLaw] = HeStiction
) -> Cells:
    """Return the cells that hold the points (J, S), shape (G, 2), behind a given first slip."""
    levels = np.full(len(points), begin.level)
    return resting_cells(u, levels, points, law, (begin.first, begin.direction))


def resting_cells(
    u: FloatArray,
    levels: FloatArray,
    points: FloatArray,
    law: type[FrictionLaw] = HeStiction,
    first: tuple[int, float] | None = None,
) -> Cells:
    """Return the cells of the points (J, S), shape (G, 2), of valves that rest at ``levels``.

    The f_S at which the first slip would change is not among their bounds.

    Args:
        levels: stem position before the first sample, %, shape (G,).
        first: sample and direction of the first slip; None lets f_S decide.
    """
    if not isinstance(law.switching, type):
        jump, reverse = np.ascontiguousarray(points.T)
        found = he_pattern_steps(u, jump, reverse, levels, *(first or (-1, 0.0)))
        offsets, places, values, bounds = found
        return Cells(bounds, StepSignals(len(u), offsets, places, values))
    rules = law.switching(u)
    traces = [rules.trace(*at, first) for at in zip(points.tolist(), levels.tolist(), strict=True)]
    bases, signs = (
        np.array([getattr(trace, name) for trace in traces]).reshape(-1, len(u)).T
        for name in ("base", "sign")
    )
    bounds = np.array([trace.bounds for trace in traces]).reshape(-1, 4)
    return Cells(bounds, StepSignals.of(bases, signs))
