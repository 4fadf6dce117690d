"""The best pattern of the semi-physical law near a model, and those that are not rejected.

Polygons are listed exactly (:mod:`stiction_ros.identification.switching.polygons`) in a region of
the (f_S, f_D) plane round the model, for the model's stem position before the first sample; f_D is
minimised over inside every polygon. The region grows until no accepted polygon touches its edge. So
within it, and for this start, the optimum is exact under the given prefilter. The start itself is
minimised over inside the best pattern only.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.effects.friction.switching import SlipPolygons
from stiction_ros.identification.exact.neighbourhood import PatternMap, refine
from stiction_ros.identification.exact.pattern_search import PatternSearch, nearby_delays
from stiction_ros.identification.problem.models import Data, Model, with_valve
from stiction_ros.identification.problem.output_error import Orders
from stiction_ros.identification.switching.patterns import has_cells
from stiction_ros.identification.switching.polygons import (
    PolygonCell,
    cell_of,
    enumerate_cells,
    region,
    trace,
)
from stiction_ros.identification.switching.scan import PatternScan

MOST_CELLS = 400
GROWTHS = 8
WIDEST = 0.05
NARROWEST = 1e-9
POLYGON_ROUNDS = 4
LEAST_GAIN = 0.3
INSIDE = 1e-6


@dataclasses.dataclass(frozen=True)
class PolygonMap:
    """The enumerated neighbourhood of a model.

    Attributes:
        scan: rows without extent in f_D, those of the accepted polygons at their corners.
        best: (f_S, f_D) of the best polygon, %.
        delays: its delay per output.
        patterns: number of polygons.
        closed: whether every polygon at the edge is rejected.
    """

    scan: PatternScan
    best: FloatArray
    delays: FloatArray
    patterns: int
    closed: bool


@dataclasses.dataclass(frozen=True)
class _Judged:
    """Polygons with their best f_D, shape (G,), loss, curvature, delays and moves."""

    cells: list[PolygonCell]
    dynamic: FloatArray
    curvature: FloatArray
    loss: FloatArray
    delays: FloatArray
    moves: FloatArray


def polygon_neighbourhood(
    data: Data, model: Model, orders: Orders, valve: int, threshold: float
) -> PolygonMap:
    """Enumerate round the model, outwards until all polygons at the edge are rejected.

    Args:
        threshold: excess of the loss over the best from which a pattern is rejected.
    """
    search = PatternSearch(data, model, orders, valve, nearby_delays(data, model, valve, 0))
    level = float(search.u[0] + model.start[valve])
    limit, friction = search.limit, model.friction[valve]
    widest = region(friction, np.full(2, WIDEST * limit), limit)
    (overshoot,) = data.further_of(valve)
    centre = cell_of(search.u, friction, overshoot, level, widest)
    judged, closed = _judge(search, [centre], level), False
    reach = np.clip(np.ptp(centre.corners, axis=0), NARROWEST * limit, WIDEST * limit)
    for _ in range(GROWTHS):
        edge = region(friction, reach, limit)
        cells = enumerate_cells(search.u, edge, overshoot, level, MOST_CELLS)
        if not cells:
            break
        judged = _judge(search, cells, level)
        accepted = judged.loss <= judged.loss.min() + threshold
        near = [cell for cell, keep in zip(cells, accepted, strict=True) if keep]
        touched = _touched(near, friction, reach)
        if not touched.any():
            closed = True
            break
        reach = np.where(touched, 2.0 * reach, reach)
    best = int(judged.loss.argmin())
    f_d = float(judged.dynamic[best])
    static = 0.5 * sum(judged.cells[best].static_range(f_d))
    return PolygonMap(
        _rows(judged, threshold),
        np.array([static, f_d]),
        judged.delays[best],
        len(judged.cells),
        closed,
    )


def refine_near(
    data: Data, model: Model, orders: Orders, valve: int, threshold: float, wander: int = 1
) -> tuple[Model, PatternMap | PolygonMap | None]:
    """Return the model with the best pattern of its neighbourhood, whatever the law's cells.

    A law that does not say what its patterns are has none, and its model stays as it is.

    A law that does not say what its patterns are has none, and its model stays as it is.

    Args:
        threshold: excess of the loss over the best from which a pattern is rejected.
        wander: how many samples delays may change in one round; polygons keep them.
    """
    if has_cells(data.law):
        return refine(data, model, orders, valve, threshold, wander)
    if not isinstance(data.law.switching, SlipPolygons):
        return model, None
    return refine_polygons(data, model, orders, valve, threshold)


def refine_polygons(
    data: Data, model: Model, orders: Orders, valve: int, threshold: float
) -> tuple[Model, PolygonMap | None]:
    """Return the model with the best pattern of its neighbourhood, and that neighbourhood.

    The map is None for a valve without friction.
    """
    if model.friction[valve, 0] <= 0.0:
        return model, None
    found = polygon_neighbourhood(data, model, orders, valve, threshold)
    for _ in range(POLYGON_ROUNDS):
        start = float(model.start[valve])
        rival = with_valve(data, model, orders, valve, found.best, start, found.delays)
        start = best_start(data, rival, orders, valve)
        rival = with_valve(data, rival, orders, valve, found.best, start, found.delays)
        if rival.loss > model.loss - LEAST_GAIN:
            break
        model = rival
        found = polygon_neighbourhood(data, model, orders, valve, threshold)
    return model, found


def best_start(data: Data, model: Model, orders: Orders, valve: int) -> float:
    """Return the best stem before the first sample minus u_0, %, under the model's pattern."""
    search = PatternSearch(data, model, orders, valve, nearby_delays(data, model, valve, 0))
    friction, first = model.friction[valve], float(search.u[0])
    (overshoot,) = data.further_of(valve)
    seen = trace(search.u, friction, overshoot, first + float(model.start[valve]))
    around = first + np.array([-1.0, 1.0]) * friction[0]
    low, high = np.clip(np.array(seen.levels(friction)), *around)
    if not low < high:
        return float(model.start[valve])
    stem = seen.alpha - seen.beta * friction[1]
    level = search.minimised(stem[:, None], -seen.gamma[:, None], np.array([[low, high]]))[0][0]
    margin = INSIDE * (high - low)
    return float(np.clip(level, low + margin, high - margin)) - first


def _judge(search: PatternSearch, cells: list[PolygonCell], level: float) -> _Judged:
    """Return every cell's best f_D, a little inside it."""
    bases = np.stack([cell.trace.alpha + level * cell.trace.gamma for cell in cells], axis=1)
    slopes = np.stack([cell.trace.beta for cell in cells], axis=1)
    low = np.array([cell.corners[:, 1].min() for cell in cells])
    high = np.array([cell.corners[:, 1].max() for cell in cells])
    margin = INSIDE * (high - low)
    ranges = np.column_stack([low + margin, high - margin])
    dynamic, curvature, loss, delays = search.minimised(bases, slopes, ranges)
    dynamic = np.clip(dynamic, ranges[:, 0], ranges[:, 1])
    moves = np.array([float(np.count_nonzero(cell.trace.slip)) for cell in cells])
    return _Judged(cells, dynamic, curvature, loss, delays, moves)


def _touched(cells: list[PolygonCell], friction: FloatArray, reach: FloatArray) -> FloatArray:
    """Return, for f_S and f_D, whether a cell meets the edge of the region."""
    far = np.array([np.abs(cell.corners - friction).max(axis=0) for cell in cells])
    return np.asarray(far.max(axis=0) >= reach * (1.0 - 1e-9))


def _rows(judged: _Judged, threshold: float) -> PatternScan:
    """Return accepted polygons at the f_D of their corners, the others at their best f_D."""
    bounds, values, loss, parents = [], [], [], []
    highest = float(judged.loss.min()) + threshold
    for i, cell in enumerate(judged.cells):
        best, curvature = float(judged.dynamic[i]), float(judged.curvature[i])
        spare = highest - float(judged.loss[i])
        at = np.array([best])
        if spare >= 0.0:
            reach = float(np.sqrt(2.0 * spare / max(curvature, 1e-300)))
            ends = cell.corners[:, 1]
            low, high = max(ends.min(), best - reach), min(ends.max(), best + reach)
            at = np.unique(np.clip(np.concatenate([at, ends]), low, high))
        for f_d in at.tolist():
            fs_low, fs_high = cell.static_range(f_d)
            bounds.append([fs_low - f_d, fs_high - f_d, fs_low + f_d, fs_high + f_d])
            values.append(f_d)
            loss.append(float(judged.loss[i]) + 0.5 * curvature * (f_d - best) ** 2)
            parents.append(i)
    f_d = np.array(values)
    return PatternScan(
        np.array(bounds),
        np.column_stack([f_d, f_d]),
        f_d,
        np.zeros(len(f_d)),
        np.array(loss),
        judged.delays[parents],
        judged.moves[parents],
    )
