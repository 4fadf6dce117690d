"""Search over the valves' friction: grids first, then exact switching patterns.

A valve's friction is found by scanning the triangle with everything else fixed
(:mod:`.scan`), closer and closer round the best points; candidates are judged by the exact
fit under the noise model (:mod:`.output_error`); the best ends in the best switching pattern
of its neighbourhood (:mod:`.pattern_search`).
"""

from __future__ import annotations

import numpy as np

from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.friction_grid import coarse_grid, even_grid, finer_grid
from stiction_ros.identification.models import (
    Criterion,
    Data,
    Model,
    scan_criteria,
    scan_valve,
    with_valve,
)
from stiction_ros.identification.output_error import Orders
from stiction_ros.identification.pattern_search import (
    PatternSearch,
    best_in_cells,
    nearby_delays,
    refine,
)

STEPS = 50
COARSE = 0.05
APART = 0.03
FINEST = 0.004
COMB = 0.0012
FIRST_PARENTS = 20
RIVALS = 2
PARENTS = 6
SWEEPS = 5
REJECTED = 4.0


def search_valve(data: Data, model: Model, orders: Orders, valve: int) -> Model:
    """Return the best model over the whole triangle of one valve; never worse than ``model``."""
    best = model
    limit, start = float(data.limit[valve]), float(model.start[valve])
    grid = coarse_grid(limit)
    fine = np.vstack([grid, even_grid(limit, STEPS)])
    one_step = scan_valve(data, model, orders, valve, fine, start, Criterion.ONE_STEP)
    others = (Criterion.FREE_RUN, Criterion.INNOVATIONS)
    scans = [one_step, *scan_criteria(data, model, orders, valve, grid, start, others)]
    rivals = []
    for criterion, scan in zip((Criterion.ONE_STEP, *others), scans, strict=True):
        parents = scan.grid[scan.best(FIRST_PARENTS, data.min_moves, 0.5 * APART * limit)]
        rivals.append(descend(data, model, orders, valve, parents, criterion, data.delay, False))
    for rival in sorted(rivals, key=lambda candidate: candidate.loss)[:RIVALS]:
        if rival.friction[valve, 0] > 0.0:
            closer = comb(data, rival, orders, valve)
            best = min(best, closer, key=lambda candidate: candidate.loss)
    if best.friction[valve, 0] == 0.0:
        return best
    best, _ = refine(data, best, orders, valve, REJECTED)
    for _ in range(SWEEPS):
        before = best.loss
        scan = scan_valve(data, best, orders, valve, grid, best.start[valve])
        chosen = grid[scan.best(PARENTS - 2, data.min_moves, COARSE * limit)]
        parents = np.vstack([best.friction[valve], chosen])
        delay = nearby_delays(data, best, valve)
        best = descend(data, best, orders, valve, parents, Criterion.INNOVATIONS, delay)
        best = comb(data, best, orders, valve)
        best, _ = refine(data, best, orders, valve, REJECTED)
        if best.loss > before - 1.0:
            break
    return best


def descend(
    data: Data,
    model: Model,
    orders: Orders,
    valve: int,
    parents: FloatArray,
    criterion: Criterion,
    delay: tuple[int, int],
    warm: bool = True,
) -> Model:
    """Scan finer and finer round several parents (f_S, f_D); return the better model.

    Args:
        parents: shape (G, 2).
        delay: range of delays scanned.
        warm: start the exact fit from that of ``model``.
    """
    limit, start = float(data.limit[valve]), float(model.start[valve])
    if not len(parents):
        return model
    patterns = None
    if data.law is HeStiction:
        patterns = PatternSearch(data, model, orders, valve, delay, criterion=criterion)
        parents, _ = best_in_cells(patterns, parents, start)
    step = APART * limit
    while step > FINEST * limit:
        step /= 3.0
        grid = finer_grid(parents, step, limit)
        scan = scan_valve(data, model, orders, valve, grid, start, criterion, delay)
        chosen = scan.best(PARENTS, data.min_moves, 1.5 * step)
        if not chosen:
            return model
        parents, delays = grid[chosen], scan.delays[chosen]
        if patterns is not None:
            parents, cells = best_in_cells(patterns, parents, start)
            order = np.argsort(cells.loss, kind="stable")
            parents, delays = parents[order], cells.delays[order]
    rival = with_valve(data, model, orders, valve, parents[0], start, delays[0], warm=warm)
    return min(model, rival, key=lambda candidate: candidate.loss)


def comb(data: Data, model: Model, orders: Orders, valve: int) -> Model:
    """Try a dense grid round the model and refine its best points; return the better model.

    With many slips the right switching pattern can be narrower than 0.1 % of the span and
    its neighbours much worse than a wrong pattern further off.
    """
    limit, start = float(data.limit[valve]), float(model.start[valve])
    delay, step = nearby_delays(data, model, valve), COMB * limit
    grid, half, best = model.friction[valve][None, :], 15, model
    for _ in range(2):
        grid = finer_grid(grid, step, limit, half)
        scan = scan_valve(data, model, orders, valve, grid, start, delay=delay)
        chosen = scan.best(PARENTS, data.min_moves, 2.0 * step)
        grid, half, step = grid[chosen], 3, step / 3.0
    for index in chosen[:2]:
        friction, delays = scan.grid[index], scan.delays[index]
        rival = with_valve(data, model, orders, valve, friction, start, delays)
        best = min(best, rival, key=lambda candidate: candidate.loss)
    return best


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
