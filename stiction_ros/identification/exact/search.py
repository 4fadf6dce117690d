"""Search over the valves' friction: grids first, then exact switching patterns.

A valve's friction is found by scanning the triangle with everything else fixed
(:mod:`stiction_ros.identification.problem.scan`), closer and closer round the best points, and in
short records on growing beginnings (:mod:`stiction_ros.identification.growing`); candidates are
judged by the exact fit under the noise model
(:mod:`stiction_ros.identification.problem.output_error`); the best ends in the best switching
pattern of its neighbourhood (:mod:`.pattern_search`).
"""

import dataclasses
from collections.abc import Mapping

import numpy as np

from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.exact.neighbourhood import REJECTED, SAMPLES, refine
from stiction_ros.identification.exact.pattern_search import PatternSearch, best_in_cells, points_of
from stiction_ros.identification.friction import Judge as Losses
from stiction_ros.identification.friction import coarse_grid, cross_grid, even_grid, finer_grid
from stiction_ros.identification.growing import first_beginning, grown
from stiction_ros.identification.kernels.scan import rows_apart
from stiction_ros.identification.problem.models import (
    FEWEST_MOVES,
    Criterion,
    Data,
    Model,
    ValveScan,
    with_valve,
)

STEPS = 80
APART = 0.03
FINEST = 0.004
COMB = 0.0012
FIRST_PARENTS = 20
RIVALS = 2
PARENTS = 6
FITTED = 3
GROWN = 4  # frictions of growing beginnings that are fitted
FINENESS = 3  # of growing beginnings, as a scan costs little
SWEEPS = 5
EXACT_SEARCH_ROUNDS = 3
CROSS = 200
LEAST_GAIN = 0.5
ALIKE = 0.9
EQUAL = 10.0
LONGEST = 1500  # samples of a record that is also taken in piece by piece


@dataclasses.dataclass(frozen=True)
class FirstScan:
    """The whole triangle of one valve under three criteria."""

    model: Model  # the model whose other valves and noise the scans saw
    valve: int  # index
    scans: Mapping[Criterion, ValveScan]  # by criterion

    @property
    def gain(self) -> float:
        """By how much the best friction beats none, in the criterion where it does most."""
        return max(float(scan.loss[0] - scan.loss[1:].min()) for scan in self.scans.values())


def first_scan(data: Data, model: Model, valve: int) -> FirstScan:
    """Scan the whole triangle of one valve, its first row without friction."""
    limit, start = float(data.limit[valve]), float(model.start[valve])
    coarse = np.vstack([np.zeros((1, 2)), coarse_grid(limit)])
    fine = np.vstack([coarse, even_grid(limit, STEPS)])
    scans = {}
    for criterion in Criterion:
        grid = fine if criterion is Criterion.ONE_STEP else coarse
        scans[criterion] = PatternSearch(data, model, valve, criterion=criterion).scan(grid, start)
    return FirstScan(model, valve, scans)


def first_search(data: Data, first: FirstScan, growing: bool) -> Model:
    """Return the best model over the whole triangle of one valve, never worse than before.

    Args:
        growing: take a short record in piece by piece as well, under He's law.
    """
    model, valve, limit = first.model, first.valve, float(data.limit[first.valve])

    def from_scan(scan: ValveScan, criterion: Criterion) -> Model:
        count = FIRST_PARENTS if criterion is Criterion.ONE_STEP else PARENTS
        chosen = scan.best(count, 0.5 * APART * limit)
        if not chosen:
            return model
        return descend(data, model, valve, scan.grid[chosen], criterion, None, False)

    rivals = []
    if growing and data.law is HeStiction and data.y.shape[1] <= LONGEST:
        rivals.append(growing_patterns(data, model, valve))
    rivals += [from_scan(scan, criterion) for criterion, scan in first.scans.items()]
    rivals.append(_from_fitted(data, first))
    promising = sorted(rivals, key=lambda candidate: candidate.loss)[:RIVALS]
    closer = [comb(data, rival, valve) for rival in promising if rival.friction[valve, 0] > 0.0]
    return min([model, *closer], key=lambda candidate: candidate.loss)


def growing_patterns(data: Data, model: Model, valve: int) -> Model:
    """Return the best model found on growing beginnings of the record, or ``model``.

    Args:
        model: gives the stems of the other valves.
    """
    limit, u, orders = float(data.limit[valve]), data.u[valve], model.orders

    def search(count: int) -> PatternSearch:
        part, shown = data.part(0, count), model.beginning(count)
        return PatternSearch(part, shown, valve, criterion=Criterion.ONE_STEP)

    def judged(count: int) -> Losses:
        one = search(count)
        return lambda rows: one.scan(rows[:, :2], rows[:, 2]).loss

    free = 2 * orders.output + len(data.u) * orders.input + orders.noise + 3
    first = first_beginning(u, limit, least=orders.first + 5 * free)
    rows, found = grown(judged, len(u), first, limit, FINENESS)
    chosen = rows[rows_apart(rows[:, :2], found, GROWN, APART * limit)]
    best, scan = model, search(len(u)).scan(chosen[:, :2], chosen[:, 2])
    for i in np.flatnonzero(scan.moves >= FEWEST_MOVES):
        start = float(scan.starts[i])
        rival = with_valve(data, model, valve, scan.grid[i], start, scan.delays[i], warm=False)
        best = min(best, rival, key=lambda candidate: candidate.loss)
    return best


def _from_fitted(data: Data, first: FirstScan) -> Model:
    """Search round the best points of the one-step scan with the noise of their own fits.

    Near a pattern that is narrow, the noise of a model without it hides it.
    """
    model, valve, scan = first.model, first.valve, first.scans[Criterion.ONE_STEP]
    apart = APART * float(data.limit[valve])
    start = float(model.start[valve])
    fitted = [
        with_valve(data, model, valve, scan.grid[i], start, scan.delays[i], warm=False)
        for i in scan.best(FITTED, apart)
    ]
    if not fitted:
        return model
    best = min(fitted, key=lambda candidate: candidate.loss)
    return descend(data, best, valve, best.friction[valve][None, :])


def improve_valve(data: Data, model: Model, valve: int) -> Model:
    """Improve one valve's friction under the model's own noise until nothing changes."""
    if model.friction[valve, 0] == 0.0:
        return model
    limit = float(data.limit[valve])
    best, _ = refine(data, model, valve, REJECTED)
    for _ in range(SWEEPS):
        before, friction = best.loss, best.friction[valve]
        jumps, reverses = neighbouring_lines(data, best, valve)
        cross = cross_grid(jumps, reverses, limit, CROSS)
        grid = np.vstack([coarse_grid(limit), cross])
        everywhere = PatternSearch(data, best, valve)
        scan = everywhere.scan(grid, float(best.start[valve]))
        chosen = grid[scan.best(PARENTS - 2, APART * limit)]
        parents = np.vstack([friction, chosen])
        best = descend(data, best, valve, parents)
        if best.loss > before - LEAST_GAIN:
            break
        best = comb(data, best, valve)
        best, _ = refine(data, best, valve, REJECTED)
    return best


def neighbouring_lines(data: Data, model: Model, valve: int) -> tuple[FloatArray, FloatArray]:
    """Return J and S of the model and just beyond its cell."""
    friction = model.friction[valve]
    (jump, reverse), limit = points_of(friction[None, :])[0], float(data.limit[valve])
    search = PatternSearch(data, model, valve, wander=1)
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
    valve: int,
    parents: FloatArray,
    criterion: Criterion = Criterion.INNOVATIONS,
    wander: int | None = 1,
    warm: bool = True,
) -> Model:
    """Scan finer and finer round several parents (f_S, f_D); return the better model.

    Args:
        parents: shape (G, 2), at least one.
        criterion, wander: of the scans, see :class:`PatternSearch`.
        warm: start the exact fit from that of ``model``.
    """
    limit, start = float(data.limit[valve]), float(model.start[valve])
    patterns = PatternSearch(data, model, valve, wander, criterion=criterion)
    parents, _ = best_in_cells(patterns, parents, start)
    step = APART * limit
    while step > FINEST * limit:
        step /= 3.0
        grid = finer_grid(parents, step, limit)
        chosen = patterns.scan(grid, start).best(PARENTS, 1.5 * step)
        if not chosen:
            return model
        parents, cells = best_in_cells(patterns, grid[chosen], start)
        order = np.argsort(cells.loss, kind="stable")
        parents, delays = parents[order], cells.delays[order]
    rival = with_valve(data, model, valve, parents[0], start, delays[0], warm=warm)
    return min(model, rival, key=lambda candidate: candidate.loss)


def comb(data: Data, model: Model, valve: int) -> Model:
    """Try a dense grid round the model and refine its best points; return the better model.

    With many slips the right switching pattern can be narrower than 0.1 % of the span and
    its neighbours much worse than a wrong pattern further off.
    """
    limit, start = float(data.limit[valve]), float(model.start[valve])
    search = PatternSearch(data, model, valve, wander=1)
    step = COMB * limit * min(1.0, SAMPLES / data.u.shape[1])
    grid, half, best = model.friction[valve][None, :], 15, model
    for _ in range(2):
        grid = finer_grid(grid, step, limit, half)
        scan = search.scan(grid, start)
        chosen = scan.best(PARENTS, 2.0 * step)
        grid, half, step = grid[chosen], 3, step / 3.0
    for index in chosen[:2]:
        friction, delays = scan.grid[index], scan.delays[index]
        rival = with_valve(data, model, valve, friction, start, delays)
        best = min(best, rival, key=lambda candidate: candidate.loss)
    return best


def search(
    data: Data, model: Model, growing: bool = True
) -> tuple[Model, tuple[tuple[int, int], ...]]:
    """Coordinate search over all valves: the most promising first, until nothing changes.

    Args:
        growing: take a short record in piece by piece as well, under He's law.

    Returns:
        The best model, and pairs (valve with friction, valve whose friction does as well).
    """
    left, rivals = list(range(len(data.u))), []
    while left:
        scans = [first_scan(data, model, valve) for valve in left]
        first = max(scans, key=lambda scan: scan.gain)
        found = first_search(data, first, growing)
        model = improve_valve(data, found, first.valve)
        left.remove(first.valve)
        for scan in scans:
            if scan is not first and scan.gain > ALIKE * first.gain > EQUAL:
                other = first_search(data, scan, growing)
                other = improve_valve(data, other, scan.valve)
                if other.loss < model.loss + EQUAL:
                    rivals.append((first.valve, scan.valve))
    if np.count_nonzero(model.friction[:, 0]) > 1:
        model = improve(data, model)
    return model, tuple(rivals)


def improve(data: Data, model: Model) -> Model:
    """Improve the friction of one sticky valve after the other until nothing changes."""
    for _ in range(EXACT_SEARCH_ROUNDS):
        gains = [0.0]
        for valve in np.flatnonzero(model.friction[:, 0]):
            better = improve_valve(data, model, int(valve))
            gains.append(model.loss - better.loss)
            model = better
        if max(gains) < LEAST_GAIN:
            break
    return model
