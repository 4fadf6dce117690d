"""The friction and the delays of least one-step SE, (12a), by He's hard law.

The default search judges by the free run under a noise model, as the one-step criterion is
biased and picks too long a delay when the noise is added to PV. What that criterion would
choose is found here, by the same means and on the scale of the paper's methods: the stem before
the first sample is the first OP, the rows are those of
:mod:`stiction_ros.identification.problem.equation_error`.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.exact.neighbourhood import (
    CELL_SAMPLES,
    SAMPLES,
    PatternMap,
    neighbourhood,
)
from stiction_ros.identification.exact.pattern_search import PatternSearch, points_of
from stiction_ros.identification.exact.search import zoom
from stiction_ros.identification.friction.grid import finer_grid
from stiction_ros.identification.problem.equation_error import (
    ArxOrders,
    Delays,
    simulate_stems,
    squared_error,
)
from stiction_ros.identification.problem.models import (
    Criterion,
    Data,
    Model,
    with_delays,
)
from stiction_ros.identification.problem.output_error import Orders
from stiction_ros.identification.result.search_log import SearchLog
from stiction_ros.identification.switching.patterns import Beginning, beginning_of
from stiction_ros.identification.switching.scan import PatternScan
from stiction_ros.records.record import Record

COMB, HALF, SHORT = 0.0016, 14, 5
BEST = 5
POLISHED = 3
POLISHES = 3  # parabolas through the least three points
TINY = 1e-3  # of the limit, below which a valve is taken up anew, from none
NEAR = 1e-4  # relative error of the search's SE, by its ridge
MOST_CELLS = 1500
SWEEPS = 2


@dataclasses.dataclass(frozen=True)
class _Point:
    friction: FloatArray
    delays: Delays
    error: float

    @property
    def place(self) -> tuple[bytes, Delays]:
        """What tells it from other points."""
        return self.friction.tobytes(), self.delays


def one_step_best(record: Record, data: Data, model: Model, orders: Orders) -> SearchLog:
    """Return the least SE and what it belongs to.

    The search starts from the frictions of ``model`` and ends in the best switching pattern
    round them, one valve after another.

    Args:
        record: as measured; SE is in its units.
        data: the same prepared for the search.
        model: the answer of the default search.
        orders: n_a and n_b.
    """
    search = _Search(record, data, orders)
    best = search.point(np.where(seen(data, model), model.friction, 0.0), model.delays)
    settled: dict[int, tuple[bytes, Delays]] = {}  # where a search of the valve found nothing
    for _ in range(1 if len(data.u) == 1 else SWEEPS):
        before = best.error
        for valve in range(len(data.u)):
            at = best.place
            if settled.get(valve) != at:
                best = search.improved(best, valve)
                if best.place == at:
                    settled[valve] = at
        if best.error > before * (1.0 - 1e-9):
            break
    return SearchLog(
        squared_error=best.error,
        objective=best.error,
        output_order=orders.output,
        input_order=orders.input,
        first=search.arx.first,
        points=search.points,
        delays_tried=data.delay[1] - data.delay[0] + 1,
        friction=tuple((float(f_s), float(f_d)) for f_s, f_d in best.friction),
        delays=best.delays,
    )


def seen(data: Data, model: Model) -> NDArray[np.bool_]:
    """Return which valves have a friction to start from, shape (m, 1)."""
    return np.asarray(model.friction[:, :1] > TINY * data.limit[:, None])


class _Search:
    def __init__(self, record: Record, data: Data, orders: Orders) -> None:
        self.record, self.points = record, 0
        longest = [data.delay[1]] * len(data.u)
        self.arx = ArxOrders.over(orders.output, orders.input, longest)
        self.orders = Orders(orders.output, orders.input, 0, self.arx.first)
        y = record.pv.T - record.pv.mean(axis=0)[:, None]
        self.data = dataclasses.replace(data, y=y)
        flat = np.zeros((len(data.u), 2))
        level = self.point(flat, tuple((data.delay[0],) * len(data.u) for _ in y)).error
        # In these units SE is near the number of samples, as −2 log likelihood would be.
        self.unit = float(np.sqrt(max(level, 1e-300) / len(y[0])))
        self.data = dataclasses.replace(data, y=y / self.unit)

    def point(self, friction: FloatArray, delays: Delays) -> _Point:
        """Return SE at given frictions and delays."""
        return _Point(friction, delays, squared_error(self.record, friction, delays, self.arx))

    def _scaled(self, loss: float) -> float:
        """Return (12a) in the record's units from SE in those of the search."""
        return loss * self.unit**2 / len(self.data.y)

    def improved(self, best: _Point, valve: int) -> _Point:
        """Return the best point over one valve's friction and delays, the others fixed."""
        limit = float(self.data.limit[valve])
        u = self.data.u[valve]
        step = COMB * limit * min(1.0, SAMPLES / len(u))
        half = HALF if len(u) <= SAMPLES else SHORT
        stems = simulate_stems(self.record.op, best.friction)
        stems = stems - self.record.op.mean(axis=0)[:, None]
        model = Model(best.friction, np.zeros(len(stems)), stems, best.delays, ())
        rows = best.friction[valve][None, :]
        criterion, ranges = Criterion.SQUARED_ERROR, self.data.delays
        search = PatternSearch(self.data, model, self.orders, valve, ranges, criterion=criterion)
        if best.friction[valve, 0] > 0.0:
            grid = finer_grid(rows, step, limit, half)
            scan = search.scan(grid, 0.0)
            self.points += len(grid)
            rows = np.vstack([rows, grid[scan.best(BEST, 0, 2.0 * step)]])
            rows = finer_grid(rows, step / 3.0, limit, 2)
        else:
            rows, _ = zoom(self.data, model, self.orders, valve, _small(limit), criterion, ranges)
        free = best.friction.copy()
        free[valve] = 0.0
        best = min(best, self.point(free, best.delays), key=lambda point: point.error)
        if not len(rows):
            return best
        scan = search.scan(rows, 0.0)
        self.points += len(rows)
        enumerated: list[PatternMap] = []
        for index in scan.best(2, 0, 2.0 * step):
            friction = scan.grid[index]
            for begin in _beginnings(u, friction, 0.003 * limit):
                if not any(_holds(known, begin, friction) for known in enumerated):
                    known = [near for near in enumerated if near.begin.slips_alike(begin)]
                    near = self._neighbourhood(search, friction, begin, known)
                    enumerated.append(near)
                    best = self._in_cells(best, search, valve, near.scan, begin)
        return best

    def _neighbourhood(
        self,
        search: PatternSearch,
        friction: FloatArray,
        begin: Beginning,
        known: list[PatternMap],
    ) -> PatternMap:
        most = min(MOST_CELLS, int(0.5 * CELL_SAMPLES / len(search.u)))
        closed = [near for near in known if near.closed]
        near = neighbourhood(search, begin, friction, 0.0, most, closed)
        self.points += near.patterns
        return near

    def _in_cells(
        self,
        best: _Point,
        search: PatternSearch,
        valve: int,
        scan: PatternScan,
        begin: Beginning,
    ) -> _Point:
        """Return the best point of the switching patterns of ``scan``."""
        u = search.u
        error = np.abs(u[: begin.first + 1] - u[0])
        band = (float(error[:-1].max(initial=0.0)), float(error[-1]))
        polished = 0
        for index in np.argsort(scan.loss, kind="stable"):
            if self._scaled(float(scan.loss[index])) > best.error * (1.0 + NEAR):
                break
            delays = with_delays(best.delays, valve, scan.delays[index])
            found = self._in_cell(best, valve, scan, int(index), band, delays)
            if found is not None:
                best = min(best, found, key=lambda point: point.error)
                polished += 1
            if polished == POLISHED:
                break
        return best

    def _in_cell(
        self,
        best: _Point,
        valve: int,
        scan: PatternScan,
        index: int,
        band: tuple[float, float],
        delays: Delays,
    ) -> _Point | None:
        """Return the least SE in one cell; None when no f_S in it lies in the band."""
        limit = float(self.data.limit[valve])

        def static(f_d: float) -> tuple[float, float]:
            low, high = scan.static_range(index, (f_d, f_d))
            return max(low, band[0]), min(high, band[1], limit)

        def at(f_d: float) -> _Point:
            rows = best.friction.copy()
            rows[valve] = 0.5 * sum(static(f_d)), f_d
            return self.point(rows, delays)

        low, high = (float(value) for value in scan.dynamic[index])
        level = float(scan.level[index])
        levels = np.append(np.linspace(low, high, 41), level)
        allowed = [f_d for f_d in levels.tolist() if static(f_d)[0] < static(f_d)[1]]
        if not allowed:
            return None
        start = min(allowed, key=lambda f_d: abs(f_d - level))
        reach = (high - low) / 40.0
        low, high = max(min(allowed), start - reach), min(max(allowed), start + reach)
        points = {start: at(start)}
        for f_d in (low, high, 0.5 * (low + high)):
            if len(points) < 3 and f_d not in points:
                points[f_d] = at(f_d)
        for _ in range(POLISHES):
            three = sorted(points, key=lambda f_d: points[f_d].error)[:3]
            f_d = min(max(_vertex(three, [points[x].error for x in three]), low), high)
            if f_d in points:
                break
            points[f_d] = at(f_d)
        return min(points.values(), key=lambda point: point.error)


def _vertex(places: list[float], errors: list[float]) -> float:
    """Return where a parabola through points, the least first, ends; the first without one."""
    if len(places) < 3:
        return places[0]
    (x, one, two), (least, _, _) = places, errors
    first, second = (errors[1] - least) / (one - x), (errors[2] - least) / (two - x)
    bend = (second - first) / (two - one)
    return x + 0.5 * (bend * (one - x) - first) / bend if bend > 0.0 else x


def _beginnings(u: FloatArray, friction: FloatArray, reach: float) -> list[Beginning]:
    """Return the first slips of a valve that rests at u_0 with f_S within ``reach``."""
    found = [
        beginning_of(u, float(u[0]), max(float(friction[0]) + shift, 0.0))
        for shift in (0.0, -reach, reach)
    ]
    found = [begin for begin in found if begin.first < len(u)]
    return list({begin.first: begin for begin in reversed(found)}.values())


def _holds(known: PatternMap, begin: Beginning, friction: FloatArray) -> bool:
    """Return whether a friction lies where all patterns of its beginning are known."""
    jl, jh, sl, sh = known.rectangle
    jump, reverse = points_of(friction[None, :])[0]
    inside = jl <= jump <= jh and sl <= reverse <= sh
    return bool(known.closed and known.begin.slips_alike(begin) and inside)


def _small(limit: float) -> FloatArray:
    """Return starts of a search for a valve in which no friction was found."""
    sizes = limit * np.array([0.01, 0.05, 0.15, 0.3])
    return np.array([[size, share * size] for size in sizes for share in (0.1, 0.5, 0.9)])
