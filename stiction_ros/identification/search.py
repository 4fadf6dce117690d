"""Coordinate search over the valves' friction.

A valve's friction is found by scanning the triangle with everything else fixed
(:mod:`.scan`); candidates are judged by the exact fit under the noise model
(:mod:`.output_error`).
"""

from __future__ import annotations

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.friction_grid import around, coarse_grid
from stiction_ros.identification.models import (
    Criterion,
    Data,
    Model,
    ValveScan,
    scan_valve,
    with_valve,
)
from stiction_ros.identification.output_error import Orders

CLOUD = 260
PARENTS = 6
SWEEPS = 6
PATIENCE = 2


def search_valve(data: Data, model: Model, orders: Orders, valve: int) -> Model:
    """Return the best model over the whole triangle of one valve; never worse than ``model``."""
    limit = float(data.limit[valve])
    grid = coarse_grid(limit)
    best, parents = model, []
    for criterion in (Criterion.ONE_STEP, Criterion.INNOVATIONS):
        scan = scan_valve(data, model, orders, valve, grid, 0.0, criterion)
        chosen = scan.best(6, data.min_moves, limit / 25.0)
        parents += [np.append(grid[index], 0.0) for index in chosen]
        for index in chosen[:2]:
            rival = with_valve(
                data, model, orders, valve, grid[index], 0.0, scan.delays[index], warm=False
            )
            best = min(best, rival, key=lambda candidate: candidate.loss)
    if best.friction[valve, 0] == 0.0:
        return best
    failures = 0
    for sweep in range(SWEEPS):
        before = best.loss
        if sweep == 0:
            rows = np.array(parents)
            for criterion in (Criterion.ONE_STEP, Criterion.FREE_RUN):
                best = evolve(data, best, orders, valve, rows, 0, criterion)
        else:
            scan = scan_valve(data, best, orders, valve, grid, best.start[valve])
            chosen = scan.best(4, data.min_moves, limit / 25.0)
            parents = [np.append(grid[index], best.start[valve]) for index in chosen]
        parents.append(np.append(best.friction[valve], best.start[valve]))
        best = evolve(data, best, orders, valve, np.array(parents), sweep)
        if failures == PATIENCE - 1 and best.loss > before - 1.0:
            best = comb(data, best, orders, valve)
        failures = failures + 1 if best.loss > before - 1.0 else 0
        if failures == PATIENCE:
            break
    return best


def comb(data: Data, model: Model, orders: Orders, valve: int) -> Model:
    """Try every point of a dense local grid, then refine the best ones.

    With many slips the right switching pattern can be narrower than 0.2 % of the span and
    its neighbours much worse than a wrong pattern further off, so clouds may pass it by.
    """
    limit, start = float(data.limit[valve]), float(model.start[valve])
    step = 1.2 * data.resolution * limit
    grid = around(model.friction[valve][None, :], step, limit, half=20)
    delay = _delay_range(data, model, valve)
    best = model
    for criterion in (Criterion.FREE_RUN, Criterion.INNOVATIONS):
        scan = scan_valve(data, model, orders, valve, grid, start, criterion, delay)
        chosen = scan.best(PARENTS, data.min_moves, 2.0 * step)
        rows = np.column_stack([grid[chosen], np.full(len(chosen), start)])
        if len(rows):
            best = evolve(data, best, orders, valve, rows, 5, criterion)
    return best


def evolve(
    data: Data,
    model: Model,
    orders: Orders,
    valve: int,
    parents: FloatArray,
    seed: int,
    criterion: Criterion = Criterion.INNOVATIONS,
) -> Model:
    """Refine (f_S, f_D, start) by shrinking clouds of points round the best ones.

    The criterion is piecewise constant in f_S with many local minima on the way down, so
    several parents are kept apart from each other in every round. Deterministic for a seed.

    Args:
        parents: rows (f_S, f_D, start ratio).
    """
    generator = np.random.default_rng(seed)
    limit = float(data.limit[valve])
    local = criterion is Criterion.INNOVATIONS
    delay = _delay_range(data, model, valve) if local else data.delay
    scale = limit / (25.0 * (1.0, 2.5, 1.0, 6.0, 1.0, 15.0)[seed])
    while True:
        rows = offspring(generator, parents, CLOUD, scale, limit)
        friction, starts = rows[:, :2], rows[:, 2]
        scan = scan_valve(data, model, orders, valve, friction, starts, criterion, delay)
        chosen = scan.best(PARENTS, data.min_moves, 0.4 * scale)
        if not chosen:
            return model
        parents = rows[chosen]
        if scale < data.resolution * limit:
            break
        scale /= 2.5
    best = model
    for index in chosen[:2]:
        best = _better(data, best, orders, valve, scan, index, float(rows[index, 2]))
    return best


def offspring(
    generator: np.random.Generator, parents: FloatArray, count: int, scale: float, limit: float
) -> FloatArray:
    """Return the parents and about ``count`` points round them, rows (f_S, f_D, start)."""
    copies = max(1, count // len(parents))
    rows = np.repeat(parents, copies, axis=0)
    size = scale * generator.choice([0.2, 1.0], (len(rows), 1))
    move = generator.standard_normal((len(rows), 2))
    # A reversal slips once u has turned by f_S + f_D, a repeated move by J = f_S − f_D: the
    # valleys of the criterion run along constant sums and constant differences.
    kind = generator.integers(0, 6, len(rows))
    move[kind == 0, 1] = 0.0
    move[kind == 1, 0] = 0.0
    move[kind == 2, 1] = move[kind == 2, 0]
    sums = (kind == 3) | (kind == 4)
    move[sums, 1] = -move[sums, 0]
    size = np.where(sums[:, None], 2.0 * size, size)
    rows[:, :2] += size * move
    rows[:, 0] = np.clip(rows[:, 0], 1e-6 * limit, limit)
    rows[:, 1] = np.clip(rows[:, 1], 0.0, rows[:, 0])
    shake = generator.standard_normal(len(rows)) * np.minimum(1.0, 8.0 * scale / limit)
    shake *= generator.random(len(rows)) < 0.5
    rows[:, 2] = np.clip(rows[:, 2] + shake, -1.0, 1.0)
    return np.vstack([parents, rows])


def _delay_range(data: Data, model: Model, valve: int) -> tuple[int, int]:
    now = [row[valve] for row in model.delays]
    return max(data.delay[0], min(now) - 1), min(data.delay[1], max(now) + 1)


def _better(
    data: Data,
    model: Model,
    orders: Orders,
    valve: int,
    scan: ValveScan,
    index: int,
    ratio: float | None = None,
) -> Model:
    """Return the exact model at one row of a scan if it beats ``model``, else ``model``."""
    start = float(model.start[valve]) if ratio is None else ratio
    friction, delays = scan.grid[index], scan.delays[index]
    rival = with_valve(data, model, orders, valve, friction, start, delays)
    return min(model, rival, key=lambda candidate: candidate.loss)


def search(data: Data, model: Model, orders: Orders, sweeps: int = 3) -> Model:
    """Coordinate search over all valves: the best improvement first, until nothing changes."""
    rivals = [search_valve(data, model, orders, valve) for valve in range(len(data.u))]
    model = min(rivals, key=lambda candidate: candidate.loss)
    if len(data.u) == 1:
        return model
    for _ in range(sweeps):
        before = model.loss
        order = np.argsort([rival.loss for rival in rivals])[::-1]
        for valve in order:
            model = search_valve(data, model, orders, int(valve))
        if model.loss > before - 2.0:
            break
    return model
