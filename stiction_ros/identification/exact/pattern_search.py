"""Evaluates switching patterns of one valve, each at its best f_D.

Patterns are listed exactly (:mod:`stiction_ros.identification.switching`) in rectangles of
the (J, S) plane. Which rectangle is worth it is for :mod:`.neighbourhood` to say; the remaining
frictions are searched on grids (:mod:`.search`).
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.kernels.level import best_levels
from stiction_ros.identification.problem.models import (
    Criterion,
    Data,
    Model,
    ValveScan,
    output_scans,
)
from stiction_ros.identification.switching import (
    Beginning,
    Cells,
    PatternScan,
    StepSignals,
    cells_at,
    first_slip_range,
    levels_of,
    levels_with,
    resting_cells,
    stem_steps,
)

BATCH = 500  # stems that are worked on together
FEW = 60  # cells too few to tell how many there will be
MOST_LEVELS = 30
INSIDE = 1e-9  # of a range; how far from its edge


class PatternSearch:
    """Evaluates patterns of one valve under one criterion, everything else fixed."""

    def __init__(
        self,
        data: Data,
        model: Model,
        valve: int,
        wander: int | None = None,
        begin: Beginning | None = None,
        criterion: Criterion = Criterion.INNOVATIONS,
    ) -> None:
        """Build the criterion.

        Args:
            data, model: of which all but the friction of ``valve`` is kept.
            valve: index.
            wander: how many samples delays may lie beside those of the model; None for all.
            begin: with it the stem before its first slip is left free.
            criterion: filter by 1, 1/A or D/A of the model's fits.
        """
        self.u, self.law = np.ascontiguousarray(data.u[valve]), data.law
        free = None if begin is None else (np.arange(len(self.u)) < begin.first).astype(float)
        self.limit = float(data.limit[valve])
        self.ranges, self.begin = nearby_delays(data, model, valve, wander), begin
        self.scans = output_scans(data, model, model.orders, valve, criterion, self.ranges, free)

    def scan(self, grid: FloatArray, starts: FloatArray | float) -> ValveScan:
        """Scan rows (f_S, f_D), shape (G, 2).

        Args:
            grid: the rows.
            starts: stem before the first sample minus first OP, %, shape (G,) or one for all.
        """
        starts = np.broadcast_to(np.asarray(starts, dtype=float), (len(grid),))
        begins = self.u[0] + starts
        loss, moves = np.zeros(len(grid)), np.zeros(len(grid))
        best = np.zeros((len(grid), len(self.scans)), dtype=int)
        for at in range(0, len(grid), BATCH):
            rows = slice(at, at + BATCH)
            stems = stem_steps(self.law, grid[rows], self.u, begins[rows])
            moves[rows] = stems.moves
            for i, scan in enumerate(self.scans):
                energy, delays = scan.least_energy(stems)
                best[rows, i] = delays + self.ranges[i][0]
                loss[rows] += scan.count * np.log(energy / scan.count)
        return ValveScan(grid, starts, loss, best, moves)

    def evaluate(self, cells: Cells) -> PatternScan:
        """Return the loss of every cell at its best f_D.

        At the very edge of a cell there is no f_S, so f_D stays a little inside.
        """
        dynamic = cells.dynamic
        most = np.maximum(self.limit - cells.bounds[:, 0], 1e-12)  # f_S = J + f_D is limited
        dynamic[:, 1] = np.clip(dynamic[:, 1], dynamic[:, 0], np.maximum(most, dynamic[:, 0]))
        edges = INSIDE * (dynamic[:, 1:] - dynamic[:, :1]) * np.array([1.0, -1.0])
        level, curvature, loss, delays = self._minimised(cells.steps, dynamic + edges)
        moves = cells.steps.moves.astype(float)
        return PatternScan(cells.bounds, dynamic, level, curvature, loss, delays, moves)

    def best_level(self, friction: FloatArray, begin: Beginning | None = None) -> float:
        """Return the stem before the first sample that suits (f_S, f_D) best, %.

        Args:
            friction: f_S and f_D, shape (2,).
            begin: where the first slip has to be, if it can be there.
        """
        f_s, f_d = (float(value) for value in friction)
        ranges = np.empty((0, 2))
        if begin is not None:
            ranges = levels_with(self.u, f_s, begin, self.law)
        if not len(ranges):
            ranges = levels_of(self.u, f_s, MOST_LEVELS, self.law)
        point = np.array([[f_s - f_d, f_s + f_d]])
        points = np.repeat(point, len(ranges), axis=0)
        cells = resting_cells(self.u, ranges.mean(axis=1), points, self.law)
        level, loss = self._levels_before(cells, f_d, ranges)
        best = int(loss.argmin())
        inside = INSIDE * (ranges[best, 1] - ranges[best, 0])
        return float(np.clip(level[best], ranges[best, 0] + inside, ranges[best, 1] - inside))

    def realised(self, scan: PatternScan, index: int, begin: Beginning) -> tuple[FloatArray, float]:
        """Return (f_S, f_D) of a cell and the stem before the first sample minus u_0, %.

        The best level under the given first slip is taken, and of the cell's f_S the middle
        of those with which a valve at that level first slips there; if there is none, the
        middle of all with the best level from which it slips there.
        """
        f_d = float(scan.level[index])
        low, high = scan.static_range(index, (f_d, f_d))
        high = min(high, self.limit)
        point = points_of(np.array([[0.5 * (low + high), f_d]]))
        cells = cells_at(self.u, begin, point, self.law)
        around = begin.level + 0.1 * self.limit * np.array([[-1.0, 1.0]])
        level = float(self._levels_before(cells, f_d, around)[0][0])
        least, most = first_slip_range(self.u, level, begin, self.law)
        if max(low, least) < min(high, most):
            static = 0.5 * (max(low, least) + min(high, most))
        else:
            static = min(0.5 * (low + high), self.limit)
            level = self.best_level(np.array([static, f_d]), begin)
        return np.array([static, f_d]), level - float(self.u[0])

    def _levels_before(
        self, cells: Cells, dynamic: float, ranges: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the best stem before the first slip at f_D, and its loss, per cell."""
        base, sign = cells.steps.values.T
        before = sign == 0.0
        stem = np.where(before, 0.0, base - dynamic * sign)
        values = np.column_stack([stem, -before.astype(float)])
        level, _, loss, _ = self._minimised(dataclasses.replace(cells.steps, values=values), ranges)
        return level, loss

    def _minimised(
        self, patterns: StepSignals, ranges: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Minimise over the level x in base − x · sign, per pattern inside its range.

        Args:
            patterns: base and sign as two channels.
            ranges: of the level, shape (G, 2).

        Returns:
            Best level (G,), second derivative (G,), loss (G,), delays (G, p).
        """
        found = [scan.products(patterns) for scan in self.scans]
        width, lags = found[0][0].shape[2], max(own.shape[3] for own, _ in found)
        products = np.zeros((patterns.size, len(found), 3, width, lags))
        rights = np.zeros((patterns.size, len(found), 2, lags))
        for i, (own, right) in enumerate(found):  # of the others there are fewer lags
            products[..., : own.shape[3]][:, i], rights[..., : own.shape[3]][:, i] = own, right
        scales = np.array([(scan.rest_energy, scan.count, scan.delays) for scan in self.scans])
        levels, second, loss, delays = best_levels(products, rights, scales, ranges)
        return levels, second, loss, delays + np.array([low for low, _ in self.ranges])

    def enumerate(self, begin: Beginning, rectangles: FloatArray, most: int) -> Cells | None:
        """Return all cells that meet the rectangles, shape (R, 4), each once.

        Args:
            most: largest number of cells; None comes back when there are more, or would be
                twice as many if the rest were covered by cells as large as those met so far.
        """
        todo = self._admissible(rectangles)
        if len(todo) > most:
            return None
        met = [cells_at(self.u, begin, np.empty((0, 2)), self.law)]
        count, whole = 0, area(todo)
        while len(todo):  # one cell of every rectangle, and what they leave
            cells = cells_at(self.u, begin, points_inside(todo), self.law)
            met.append(cells)
            todo = self._admissible(remainders(todo, cells.bounds))
            count += len(cells.bounds)
            covered = whole - area(todo)
            too_many = count + len(todo) > most
            if len(todo) and (too_many or (count > FEW and count * whole > 2.0 * most * covered)):
                return None
        return Cells.joined(met).distinct()

    def _admissible(self, rectangles: FloatArray) -> FloatArray:
        """Return the rectangles that hold frictions 0 ≤ f_D ≤ f_S ≤ limit."""
        smallest = 1e-12 * self.limit
        jl, jh, sl, sh = rectangles.T
        fits = (jh - jl > smallest) & (sh - sl > smallest) & (sh > jl)
        fits &= jl + sl < 2.0 * self.limit
        return np.asarray(rectangles[fits])


def points_of(friction: FloatArray) -> FloatArray:
    """Return rows (J, S) of rows (f_S, f_D)."""
    static, dynamic = friction[:, 0], friction[:, 1]
    return np.column_stack([static - dynamic, static + dynamic])


def nearby_delays(
    data: Data, model: Model, valve: int, wander: int | None
) -> tuple[tuple[int, int], ...]:
    """Return, per output, the delays of a valve within ``wander`` samples of the model's."""
    low, high = data.delay
    wander = high - low if wander is None else wander
    now = [row[valve] for row in model.delays]
    return tuple((max(low, d - wander), min(high, d + wander)) for d in now)


def best_in_cells(
    search: PatternSearch, friction: FloatArray, start: float
) -> tuple[FloatArray, PatternScan]:
    """Return rows (f_S, f_D) moved to the best of their cells, and the cells.

    Where a valve slips seldom a cell is wide and f_D at a grid point far from the best.

    Args:
        friction: rows (f_S, f_D), shape (G, 2).
        start: stem before the first sample minus u_0, %.
    """
    levels = np.full(len(friction), float(search.u[0]) + start)
    scan = search.evaluate(resting_cells(search.u, levels, points_of(friction), search.law))
    rows = [scan.middle(index, search.limit) for index in range(len(friction))]
    return np.array(rows), scan


def area(rectangles: FloatArray) -> float:
    """Return the area of all rectangles."""
    jl, jh, sl, sh = rectangles.T
    return float((jh - jl) @ (sh - sl))


def points_inside(rectangles: FloatArray) -> FloatArray:
    """Return one point (J, S) with S ≥ J inside every rectangle, the middle where possible."""
    jl, jh, sl, sh = rectangles.T
    jump, reverse = 0.5 * (jl + jh), 0.5 * (sl + sh)
    outside = reverse < jump
    jump = np.where(outside, jl + 0.1 * (np.minimum(jh, sh) - jl), jump)
    reverse = np.where(outside, sh - 0.1 * (sh - np.maximum(sl, jl)), reverse)
    return np.column_stack([jump, reverse])


def remainders(rectangles: FloatArray, cells: FloatArray) -> FloatArray:
    """Return up to four rectangles per row: what its cell does not cover."""
    jl, jh, sl, sh = rectangles.T
    cl, ch = np.maximum(cells[:, 0], jl), np.minimum(cells[:, 1], jh)
    dl, dh = np.maximum(cells[:, 2], sl), np.minimum(cells[:, 3], sh)
    return np.concatenate(
        [
            np.column_stack([jl, cl, sl, sh]),
            np.column_stack([ch, jh, sl, sh]),
            np.column_stack([cl, ch, sl, dl]),
            np.column_stack([cl, ch, dh, sh]),
        ]
    )


def overlapping(rectangles: FloatArray, other: FloatArray) -> NDArray[np.bool_]:
    """Return which rectangles share more than an edge with another one, shape (R,)."""
    jl, jh, sl, sh = rectangles.T
    meets = (jl < other[1]) & (jh > other[0]) & (sl < other[3]) & (sh > other[2])
    return np.asarray(meets)
