"""The frictions that are searched: grids over 0 ≤ f_D ≤ f_S ≤ limit, and a law's other parameters.

f_S and f_D are searched with the others held. Before that, and again from what was found, points
are scattered in ever smaller boxes over all parameters of one valve together, as an optimum may
be a needle in a valley of several of them. One function judges them all.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from stiction_ros.checks import one_of
from stiction_ros.deferred import halton_sequence
from stiction_ros.effects import Behaviour, FloatArray, FrictionLaw, Parameter, Stiction, behaviours
from stiction_ros.errors import InputError

BEGINNINGS = (-0.9, -0.6, -0.3, 0.3, 0.6, 0.9)  # of a stem, shares of f_S away from OP
Judge = Callable[[FloatArray], FloatArray]
"""The loss of rows (f_S, f_D, further parameters …, start), shape (G, 3 + n), as shape (G,)."""
POINTS = 9  # per further parameter in the first grid
MOST_POINTS = 60  # combinations of them
PROPORTION = 20.0  # ratio of the ends from which on a range is searched in proportion
UNBOUNDED = 100.0  # factor either way round its default where a parameter has no end
THROWS = 14
THROWN = 3000
CENTRES = 30  # of the first boxes; with every throw the better half stays
LEAST_CENTRES = 4
RANKED = 3000  # best points of which they are taken
SHRINK = 0.65
BOX = 0.12  # of the first box: half its width, as a share of a range


def laws() -> dict[str, type[FrictionLaw]]:
    """Return every law that can be identified, by its name."""
    return {kind.law: kind for kind in _stictions() if kind.law and issubclass(kind, FrictionLaw)}


def _stictions() -> list[type[Behaviour]]:
    return [kind for kind in behaviours() if kind.effect == Stiction.effect]


def find_law(name: str) -> type[FrictionLaw]:
    """Return the friction law called ``name``.

    Raises:
        InputError: no such law, or one that is not identified.
    """
    known = laws()
    if name not in known and any(kind.law == name for kind in _stictions()):
        raise InputError(
            f"law {name!r} is not identified: it is not derived from FrictionPair or SlipJumpPair",
            where="law",
            fix=f"known laws: {', '.join(known)}",
        )
    return known[one_of(name, known, "law", "friction law")]


def triangle(limit: float, steps: int, first: int = 1) -> FloatArray:
    """Return an even triangular grid of rows (f_S, f_D), f_S from ``first`` steps to ``limit``."""
    nodes = np.arange(steps + 1) * (limit / steps)
    rows = [(nodes[i], nodes[j]) for i in range(first, steps + 1) for j in range(i + 1)]
    return np.array(rows, dtype=float)


def coarse_grid(limit: float) -> FloatArray:
    """Return the first grid: 20 steps over the whole triangle, finer towards small friction."""
    fine = [triangle(limit / 4.0, 14), triangle(limit / 20.0, 8), triangle(limit / 100.0, 4)]
    return _without_repetition(np.vstack([triangle(limit, 20), *fine]))


def _without_repetition(rows: FloatArray) -> FloatArray:
    """Return rows (f_S, f_D), rounded, in rising order, each once."""
    pairs = np.ascontiguousarray(rows.round(12)).view(np.complex128)[:, 0]
    return np.unique(pairs).view(np.float64).reshape(-1, 2)


def even_grid(limit: float, steps: int) -> FloatArray:
    """Return the triangle in even steps of J = f_S − f_D and S = f_S + f_D, limit / steps each."""
    nodes = (np.arange(2 * steps) + 0.5) * (limit / steps)
    jump, reverse = (part.ravel() for part in np.meshgrid(nodes, nodes, indexing="ij"))
    return _rows(jump, reverse, limit)


def cross_grid(jumps: FloatArray, reverses: FloatArray, limit: float, steps: int) -> FloatArray:
    """Return lines of the given J, along S, and of the given S, along J, limit / steps apart."""
    fine = (np.arange(2 * steps) + 0.5) * (limit / steps)
    jump = np.concatenate([np.repeat(jumps, len(fine)), np.tile(fine, len(reverses))])
    reverse = np.concatenate([np.tile(fine, len(jumps)), np.repeat(reverses, len(fine))])
    return _rows(jump, reverse, limit)


def _rows(jump: FloatArray, reverse: FloatArray, limit: float) -> FloatArray:
    """Return rows (f_S, f_D) of the points (J, S) inside the triangle."""
    inside = (jump >= 0.0) & (reverse >= jump) & (jump + reverse <= 2.0 * limit)
    return 0.5 * np.column_stack([reverse + jump, reverse - jump])[inside]


def finer_grid(centres: FloatArray, step: float, limit: float, half: int = 3) -> FloatArray:
    """Return grids of (2·half + 1)² rows round each centre, kept inside the triangle.

    Even in the plane of J = f_S − f_D and S = f_S + f_D, along which the valleys of the
    criterion run: a reversal slips once OP has turned by S, a repeated move by J.
    """
    offsets = np.arange(-half, half + 1) * step
    jump, reverse = (part.ravel() for part in np.meshgrid(offsets, offsets, indexing="ij"))
    mesh = 0.5 * np.column_stack([reverse + jump, reverse - jump])
    rows = (centres[:, None, :] + mesh[None]).reshape(-1, 2)
    static = np.clip(rows[:, 0], 0.0, limit)
    dynamic = np.clip(rows[:, 1], 0.0, static)
    grid = _without_repetition(np.column_stack([static, dynamic]))
    return np.asarray(grid[grid[:, 0] > 0.0])


def with_beginnings(grid: FloatArray, away: FloatArray) -> FloatArray:
    """Return rows (f_S, f_D, start): ``grid`` from OP, ``away`` from each of the other places."""
    rows = [np.column_stack([grid, np.zeros(len(grid))])]
    rows += [np.column_stack([away, share * away[:, 0]]) for share in BEGINNINGS]
    return np.vstack(rows)


def behaviour_of(
    law: str, frictions: tuple[float, float], further: Mapping[str, float]
) -> Stiction:
    """Return a law by its name, with f_S and f_D in % and its further parameters by their keys."""
    static, dynamic = frictions
    kind = find_law(law)
    own = kind.rows_of_frictions(np.array([[static, min(dynamic, static)]]))[0].tolist()
    keys = [entry.key for entry in kind.parameters()]
    found = kind.from_mapping(dict(zip(keys, own, strict=False)) | dict(further))
    assert isinstance(found, Stiction)
    return found


def simulate(
    law: type[FrictionLaw],
    grid: FloatArray,
    u: FloatArray,
    start: FloatArray | float,
    further: Sequence[float] = (),
) -> FloatArray:
    """Return stems, shape (N, G), for rows (f_S, f_D, …) and OP u, shape (N,).

    Laws with other parameters, such as S and J, get those that are equivalent.

    Args:
        law: whose stems.
        grid: shape (G, 2), or with all further parameters of the law behind.
        u: OP, %.
        start: stem before the first sample, %, one for all or shape (G,).
        further: values of its further parameters for rows that have none.
    """
    rows = law.rows_of_frictions(grid[:, :2])
    if grid.shape[1] > 2:
        rows = np.column_stack([rows, grid[:, 2:]])
    elif len(further):
        rows = np.column_stack([rows, np.tile(further, (len(rows), 1))])
    return law.simulate_grid(rows, u, start)


@dataclasses.dataclass(frozen=True)
class Range:
    """Where one further parameter is searched."""

    key: str  # its name in YAML
    low: float  # low, high: ends
    high: float
    first: float  # value it begins at
    logarithmic: bool  # whether in proportion

    @classmethod
    def of(cls, entry: Parameter, default: float | None) -> "Range":
        """Return the range of a parameter: its bounds, or some way round its default."""
        low, high = entry.low, entry.high
        centre = default if default is not None else 1.0
        if not math.isfinite(low):
            low = -UNBOUNDED * max(abs(centre), 1.0)
        if not math.isfinite(high):
            high = max(UNBOUNDED * abs(centre), low + UNBOUNDED)
        logarithmic = low > 0.0 and high / low > PROPORTION
        if default is None:
            centre = math.sqrt(low * high) if logarithmic else 0.5 * (low + high)
        return cls(entry.key, low, high, min(max(centre, low), high), logarithmic)

    def outer(self, shares: FloatArray) -> FloatArray:
        """Return the values at shares 0 … 1 of the range; what lies beyond ends there."""
        shares = np.clip(shares, 0.0, 1.0)
        if self.logarithmic:
            return np.asarray(self.low * (self.high / self.low) ** shares)
        return np.asarray(self.low + shares * (self.high - self.low))

    def inner(self, values: FloatArray) -> FloatArray:
        """Return the shares that belong to values."""
        if self.high == self.low:
            return np.zeros_like(values)
        if self.logarithmic:
            return np.asarray(np.log(values / self.low) / math.log(self.high / self.low))
        return np.asarray((values - self.low) / (self.high - self.low))


def ranges_of(law: type[FrictionLaw]) -> tuple[Range, ...]:
    """Return where the parameters of a law behind its first two are searched."""
    fields = {f.name: f.default for f in dataclasses.fields(law)}
    found = []
    for entry in law.parameters()[2:]:
        default = fields[entry.attribute]
        given = None if default is dataclasses.MISSING else float(default)
        if entry.key in law.held and given is not None:
            found.append(Range(entry.key, given, given, given, False))
            continue
        found.append(Range.of(entry, given))
    return tuple(found)


def first_values(law: type[FrictionLaw]) -> tuple[float, ...]:
    """Return the values that the further parameters of a law begin at."""
    return tuple(each.first for each in ranges_of(law))


def searched(law: type[FrictionLaw]) -> tuple[str, ...]:
    """Return the keys of the further parameters of a law that are not held."""
    return tuple(each.key for each in ranges_of(law) if each.high > each.low)


@dataclasses.dataclass(frozen=True)
class Settled:
    """Every point that was judged, best first."""

    rows: FloatArray  # (f_S, f_D, further …, start), %, shape (G, 3 + n)
    loss: FloatArray  # shape (G,)

    def accepted(self, slack: float) -> FloatArray:
        """Return the rows that are worse than the best by no more than ``slack``."""
        return np.asarray(self.rows[self.loss <= self.loss[0] + slack])


class FurtherSearch:
    """Points over all parameters of one valve, in coordinates of one size."""

    def __init__(self, law: type[FrictionLaw], limit: float, judge: Judge) -> None:
        """Take the law, the largest f_S in %, and what judges."""
        self.ranges, self.limit, self.judge = ranges_of(law), limit, judge
        self._rows: list[FloatArray] = []
        self._loss: list[FloatArray] = []

    def everywhere(self) -> Settled:
        """Judge the whole triangle of frictions with every combination of the others."""
        each = min(POINTS, max(int(MOST_POINTS ** (1.0 / len(self.ranges))), 2))
        axes = [np.unique([*r.outer(np.linspace(0.0, 1.0, each)), r.first]) for r in self.ranges]
        mesh = np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")], axis=1)
        grid = coarse_grid(self.limit)
        rows = np.hstack(
            [
                np.repeat(grid, len(mesh), axis=0),
                np.tile(mesh, (len(grid), 1)),
                np.zeros((len(grid) * len(mesh), 1)),
            ]
        )
        self._take(rows)
        return self._scattered(BOX)

    def round_about(self, row: FloatArray, size: float = 0.1) -> Settled:
        """Judge points round a row, closer and closer.

        Args:
            row: (f_S, f_D, further …, start), shape (3 + n,).
            size: half the width of the first box, as a share of the ranges.
        """
        self._take(row[None, :])
        return self._scattered(size)

    def _scattered(self, size: float) -> Settled:
        halton = halton_sequence(3 + len(self.ranges), seed=0)
        count = CENTRES
        for _ in range(THROWS):
            found = self._found()
            centres = self._apart(found, count, 0.5 * size)
            cubes = 2.0 * halton.random(THROWN) - 1.0
            at = centres[np.arange(THROWN) % len(centres)] + size * cubes
            self._take(self._outer(at))
            size, count = size * SHRINK, max(count // 2, LEAST_CENTRES)
        return self._found()

    def _apart(self, found: Settled, count: int, distance: float) -> FloatArray:
        """Return coordinates of the best points that are apart in one coordinate at least."""
        at = self._inner(found.rows[:RANKED])
        chosen: list[FloatArray] = []
        for place in at:
            if all(np.abs(place - other).max() > distance for other in chosen):
                chosen.append(place)
            if len(chosen) == count:
                break
        return np.array(chosen)

    def _take(self, rows: FloatArray) -> None:
        self._rows.append(rows)
        self._loss.append(self.judge(rows))

    def _found(self) -> Settled:
        rows, loss = np.vstack(self._rows), np.concatenate(self._loss)
        order = np.argsort(loss, kind="stable")
        return Settled(rows[order], loss[order])

    def _inner(self, rows: FloatArray) -> FloatArray:
        """Return coordinates: S and J over the limit, shares of ranges, start over f_S."""
        static, dynamic = rows[:, 0], rows[:, 1]
        columns = [(static + dynamic) / self.limit, (static - dynamic) / self.limit]
        columns += [r.inner(rows[:, 2 + k]) for k, r in enumerate(self.ranges)]
        columns.append(rows[:, -1] / np.maximum(static, 1e-9 * self.limit))
        return np.column_stack(columns)

    def _outer(self, at: FloatArray) -> FloatArray:
        band = np.clip(at[:, 0], 0.0, 2.0) * self.limit
        jump = np.clip(at[:, 1] * self.limit, 0.0, band)
        static = np.clip(0.5 * (band + jump), 1e-6 * self.limit, self.limit)
        dynamic = np.clip(0.5 * (band - jump), 0.0, static)
        columns = [static, dynamic]
        columns += [r.outer(at[:, 2 + k]) for k, r in enumerate(self.ranges)]
        columns.append(np.clip(at[:, -1], -1.0, 1.0) * static)
        return np.column_stack(columns)
