"""The exact polish: from a friction that the search gives to the best switching pattern.

One valve's friction is scanned under the noise of its own model, on the whole triangle and closer
and closer round the best points; the best ends in the best switching pattern of its neighbourhood
(:mod:`.pattern_search`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.exact.neighbourhood import REJECTED, SAMPLES
from stiction_ros.identification.exact.pattern_search import (
    PatternSearch,
    best_in_cells,
    nearby_delays,
    points_of,
)
from stiction_ros.identification.exact.polygon_search import refine_near
from stiction_ros.identification.friction.grid import coarse_grid, cross_grid, finer_grid
from stiction_ros.identification.problem.models import (
    Data,
    DelayRanges,
    Model,
    scan_valve,
    with_valve,
)
from stiction_ros.identification.problem.output_error import Orders
from stiction_ros.identification.switching.patterns import has_cells

APART = 0.03
FINEST = 0.004
COMB = 0.0012
PARENTS = 6
SWEEPS = 5
EXACT_SEARCH_ROUNDS = 3
CROSS = 200
LEAST_GAIN = 0.5


def polished(data: Data, orders: Orders, heads: Sequence[Model]) -> Model:
    """Return the best model that the heads of a search lead to.

    Each is looked round closely, as the best of them under one noise may lead to a pattern that
    another one beats under its own.

    Args:
        data: the record.
        orders: of the process.
        heads: one model for each friction, fitted.
    """
    near = [look_round(data, head, orders) for head in heads]
    return improve(data, min(near, key=lambda model: model.loss), orders)


def look_round(data: Data, model: Model, orders: Orders) -> Model:
    """Return the best model close round the friction of each valve."""
    for valve in np.flatnonzero(model.friction[:, 0]).tolist():
        parents, ranges = model.friction[valve][None, :], nearby_delays(data, model, valve)
        model = descend(data, model, orders, valve, parents, ranges)
        model = comb(data, model, orders, valve)
        model, _ = refine_near(data, model, orders, valve, REJECTED)
    return model


def improve_valve(data: Data, model: Model, orders: Orders, valve: int) -> Model:
    """Improve one valve's friction under the model's own noise until nothing changes."""
    if model.friction[valve, 0] == 0.0:
        return model
    limit = float(data.limit[valve])
    best, _ = refine_near(data, model, orders, valve, REJECTED)
    for _ in range(SWEEPS):
        before, friction = best.loss, best.friction[valve]
        jumps, reverses = neighbouring_lines(data, best, orders, valve)
        cross = cross_grid(jumps, reverses, limit, CROSS)
        grid = np.vstack([coarse_grid(limit), cross])
        scan = scan_valve(data, best, orders, valve, grid, best.start[valve])
        chosen = grid[scan.best(PARENTS - 2, data.min_moves, APART * limit)]
        parents = np.vstack([friction, chosen])
        ranges = nearby_delays(data, best, valve)
        best = descend(data, best, orders, valve, parents, ranges)
        if best.loss > before - LEAST_GAIN:
            break
        best = comb(data, best, orders, valve)
        best, _ = refine_near(data, best, orders, valve, REJECTED)
    return best


def neighbouring_lines(
    data: Data, model: Model, orders: Orders, valve: int
) -> tuple[FloatArray, FloatArray]:
    """Return J and S of the model and, where the law has cells, just beyond its cell."""
    friction = model.friction[valve]
    (jump, reverse), limit = points_of(friction[None, :])[0], float(data.limit[valve])
    if not has_cells(data.law):
        return np.array([jump]), np.array([reverse])
    search = PatternSearch(data, model, orders, valve, nearby_delays(data, model, valve))
    _, cells = best_in_cells(search, friction[None, :], float(model.start[valve]))
    jl, jh, sl, sh = np.clip(cells.bounds[0], 0.0, 2.0 * limit)
    beyond = [
        np.clip(0.3 * (high - low), 1e-4 * limit, 3e-3 * limit)
        for low, high in ((jl, jh), (sl, sh))
    ]
    return (
        np.array([jl - beyond[0], jump, jh + beyond[0]]),
        np.array([sl - beyond[1], reverse, sh + beyond[1]]),
    )


def descend(
    data: Data,
    model: Model,
    orders: Orders,
    valve: int,
    parents: FloatArray,
    ranges: DelayRanges,
) -> Model:
    """Scan finer and finer round several parents (f_S, f_D); return the better model.

    Args:
        parents: shape (G, 2).
        ranges: delays scanned, per output.
    """
    rows, delays = zoom(data, model, orders, valve, parents, ranges)
    if not len(rows):
        return model
    start = float(model.start[valve])
    rival = with_valve(data, model, orders, valve, rows[0], start, delays[0])
    return min(model, rival, key=lambda candidate: candidate.loss)


def zoom(
    data: Data,
    model: Model,
    orders: Orders,
    valve: int,
    parents: FloatArray,
    ranges: DelayRanges,
) -> tuple[FloatArray, FloatArray]:
    """Return the best rows (f_S, f_D) of ever finer grids round the parents, and delays.

    Returns:
        Rows, best first, shape (G, 2), G = 0 when the valve moves too seldom in all of them,
        and delays per output, shape (G, p).
    """
    limit, start = float(data.limit[valve]), float(model.start[valve])
    nothing = np.empty((0, 2)), np.empty((0, len(data.y)), dtype=int)
    if not len(parents):
        return nothing
    patterns = PatternSearch(data, model, orders, valve, ranges)
    if has_cells(data.law):
        parents, _ = best_in_cells(patterns, parents, start)
    step = APART * limit
    while step > FINEST * limit:
        step /= 3.0
        grid = finer_grid(parents, step, limit)
        scan = patterns.scan(grid, start)
        chosen = scan.best(PARENTS, data.min_moves, 1.5 * step)
        if not chosen:
            return nothing
        parents, delays = grid[chosen], scan.delays[chosen]
        if has_cells(data.law):
            parents, cells = best_in_cells(patterns, parents, start)
            order = np.argsort(cells.loss, kind="stable")
            parents, delays = parents[order], cells.delays[order]
    return parents, delays


def comb(data: Data, model: Model, orders: Orders, valve: int) -> Model:
    """Try a dense grid round the model and refine its best points; return the better model.

    With many slips the right switching pattern can be narrower than 0.1 % of the span and
    its neighbours much worse than a wrong pattern further off.
    """
    limit, start = float(data.limit[valve]), float(model.start[valve])
    search = PatternSearch(data, model, orders, valve, nearby_delays(data, model, valve))
    step = COMB * limit * min(1.0, SAMPLES / data.u.shape[1])
    grid, half, best = model.friction[valve][None, :], 15, model
    for _ in range(2):
        grid = finer_grid(grid, step, limit, half)
        scan = search.scan(grid, start)
        chosen = scan.best(PARENTS, data.min_moves, 2.0 * step)
        grid, half, step = grid[chosen], 3, step / 3.0
    for index in chosen[:2]:
        friction, delays = scan.grid[index], scan.delays[index]
        rival = with_valve(data, model, orders, valve, friction, start, delays)
        best = min(best, rival, key=lambda candidate: candidate.loss)
    return best


def improve(data: Data, model: Model, orders: Orders) -> Model:
    """Improve the friction of one sticky valve after the other until nothing changes."""
    for _ in range(EXACT_SEARCH_ROUNDS):
        gains = [0.0]
        for valve in np.flatnonzero(model.friction[:, 0]):
            better = improve_valve(data, model, orders, int(valve))
            gains.append(model.loss - better.loss)
            model = better
        if max(gains) < LEAST_GAIN:
            break
    return model
