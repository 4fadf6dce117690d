"""Coordinate search over the valves' friction, the delays and the linear parts.

A valve's friction is found by scanning the triangle with everything else fixed
(:mod:`.scan`); candidates are judged by the exact fit under the noise model
(:mod:`.output_error`). Delays are chosen channel by channel.
"""

from __future__ import annotations

import dataclasses
import enum

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, SimulatesGrid
from stiction_ros.identification.friction_grid import (
    coarse_grid,
    count_moves,
    simulate,
    switching_bounds,
)
from stiction_ros.identification.output_error import Orders, OutputFit, fit_output
from stiction_ros.identification.scan import OutputScan

BLOCK = 1_500_000
CLOUD = 260
PARENTS = 6
SWEEPS = 6
PATIENCE = 2
DELAY_MARGIN = 2.0


class Criterion(enum.Enum):
    """Prefilter of a scan: which error of the current model counts."""

    ONE_STEP = enum.auto()
    FREE_RUN = enum.auto()
    INNOVATIONS = enum.auto()


@dataclasses.dataclass(frozen=True)
class Data:
    """One record prepared for the search.

    Attributes:
        y: outputs about their mean in units of their standard deviation, shape (p, N).
        u: OP about its mean, %, shape (m, N).
        law: friction law.
        limit: largest f_S per valve, %, shape (m,).
        delay: inclusive range of t_d.
        min_moves: fewest stem moves of an accepted candidate.
        resolution: final step of the grid as a share of the limit.
    """

    y: FloatArray
    u: FloatArray
    law: type[SimulatesGrid]
    limit: FloatArray
    delay: tuple[int, int]
    min_moves: int
    resolution: float


@dataclasses.dataclass(frozen=True)
class Model:
    """Friction, stems, delays and fits of the whole record.

    Attributes:
        friction: (f_S, f_D) per valve, shape (m, 2), %.
        start: stem before the first sample minus first OP, in units of f_S, shape (m,).
        stems: shape (m, N), about the mean of the OP.
        delays: one tuple of m delays per output.
        fits: one fit per output.
    """

    friction: FloatArray
    start: FloatArray
    stems: FloatArray
    delays: tuple[tuple[int, ...], ...]
    fits: tuple[OutputFit, ...]

    @property
    def loss(self) -> float:
        """Sum over outputs of n log(mean squared innovation)."""
        return float(sum(fit.loss for fit in self.fits))

    @property
    def bic(self) -> float:
        """BIC of the linear parts and noise; friction is not counted here."""
        return float(sum(fit.bic for fit in self.fits))


@dataclasses.dataclass(frozen=True)
class ValveScan:
    """Result of one scan.

    Attributes:
        grid: rows (f_S, f_D), shape (G, 2).
        loss: best over the delays, summed over outputs, shape (G,).
        delays: the best delay per output, shape (G, p).
        moves: shape (G,).
        stayed, slipped: range of f_S with the same switching pattern, shape (G,).
    """

    grid: FloatArray
    loss: FloatArray
    delays: FloatArray
    moves: FloatArray
    stayed: FloatArray
    slipped: FloatArray

    def best(self, count: int, min_moves: int, apart: float) -> list[int]:
        """Return up to ``count`` best rows at least ``apart`` from each other."""
        chosen: list[int] = []
        for index in np.argsort(self.loss, kind="stable"):
            if self.moves[index] < min_moves:
                continue
            near = [np.abs(self.grid[index] - self.grid[i]).max() < apart for i in chosen]
            if not any(near):
                chosen.append(int(index))
            if len(chosen) == count:
                break
        return chosen


def stem_of(data: Data, valve: int, friction: FloatArray, ratio: float) -> FloatArray:
    """Return the stem of one valve, shape (N,)."""
    u = data.u[valve]
    stems = simulate(data.law, friction[None, :], u, float(u[0] + ratio * friction[0]))
    return np.asarray(stems[0])


def scan_valve(
    data: Data,
    model: Model,
    orders: Orders,
    valve: int,
    grid: FloatArray,
    ratios: FloatArray | float,
    criterion: Criterion = Criterion.INNOVATIONS,
    delay: tuple[int, int] | None = None,
) -> ValveScan:
    """Scan the friction of ``valve`` with the other valves of ``model`` fixed.

    Args:
        ratios: start of the stem in units of f_S, shape (G,) or one for all.
        criterion: filter by 1, 1/A or D/A of the model's fits.
        delay: range of delays scanned; None is that of the data.
    """
    others = [j for j in range(len(data.u)) if j != valve]
    one = np.ones(1)
    scans = [
        OutputScan(
            y,
            model.stems[others],
            tuple(delays[j] for j in others),
            orders,
            delay or data.delay,
            fit.noise if criterion is Criterion.INNOVATIONS else one,
            fit.a if criterion is not Criterion.ONE_STEP else one,
        )
        for y, fit, delays in zip(data.y, model.fits, model.delays, strict=True)
    ]
    u = data.u[valve]
    start = u[0] + np.broadcast_to(np.asarray(ratios, dtype=float), (len(grid),)) * grid[:, 0]
    size = max(1, BLOCK // len(u))
    loss, best, moves, stayed, slipped = [], [], [], [], []
    for low in range(0, len(grid), size):
        rows = slice(low, low + size)
        stems = simulate(data.law, grid[rows], u, start[rows])
        losses = [scan.loss(stems) for scan in scans]
        loss.append(sum(values.min(axis=1) for values in losses))
        best.append(np.stack([values.argmin(axis=1) for values in losses], axis=1))
        moves.append(count_moves(stems))
        bounds = switching_bounds(stems, u, start[rows], grid[rows, 0])
        stayed.append(bounds[0])
        slipped.append(bounds[1])
    first = (delay or data.delay)[0]
    return ValveScan(
        grid,
        np.concatenate(loss),
        np.concatenate(best) + first,
        np.concatenate(moves),
        np.concatenate(stayed),
        np.concatenate(slipped),
    )


def with_valve(
    data: Data,
    model: Model,
    orders: Orders,
    valve: int,
    friction: FloatArray,
    ratio: float,
    delays: FloatArray,
    warm: bool = True,
) -> Model:
    """Return the exact model with one valve's friction and delays replaced."""
    stems = model.stems.copy()
    stems[valve] = stem_of(data, valve, friction, ratio)
    all_friction, start = model.friction.copy(), model.start.copy()
    all_friction[valve], start[valve] = friction, ratio
    return refit(
        data,
        dataclasses.replace(
            model,
            friction=all_friction,
            start=start,
            stems=stems,
            delays=tuple(
                tuple(int(delays[i]) if j == valve else d for j, d in enumerate(row))
                for i, row in enumerate(model.delays)
            ),
        ),
        orders,
        warm,
    )


def refit(data: Data, model: Model, orders: Orders, warm: bool = True) -> Model:
    """Return the model with all outputs fitted to its stems and delays."""
    fits = []
    for i, y in enumerate(data.y):
        old = model.fits[i] if warm and i < len(model.fits) else None
        usable = old if old is not None and old.orders == orders else None
        fits.append(fit_output(y, model.stems, model.delays[i], orders, usable))
    return dataclasses.replace(model, fits=tuple(fits))


def linear_model(data: Data, orders: Orders, base: Model | None = None) -> Model:
    """Return the best model with the stems of ``base``; friction-free when None."""
    m, p = len(data.u), len(data.y)
    if base is None:
        zero = np.zeros((m, 2))
        delays = tuple((data.delay[0],) * m for _ in range(p))
        base = Model(zero, np.zeros(m), data.u.copy(), delays, ())
    model = refit(data, base, orders, warm=False)
    for _ in range(3):
        before = model.loss
        model = improve_delays(data, model, orders)
        if model.loss > before - 1e-3:
            break
    return model


def improve_delays(data: Data, model: Model, orders: Orders) -> Model:
    """Scan all delays of every channel with friction fixed; keep what the exact fit favours."""
    if data.delay[0] == data.delay[1]:
        return model
    for valve in range(len(data.u)):
        for criterion in (Criterion.ONE_STEP, Criterion.INNOVATIONS):
            friction = model.friction[valve][None, :]
            scan = scan_valve(data, model, orders, valve, friction, model.start[valve], criterion)
            now = [row[valve] for row in model.delays]
            if list(scan.delays[0]) == now:
                continue
            rival = with_valve(
                data,
                model,
                orders,
                valve,
                friction[0],
                model.start[valve],
                scan.delays[0],
                warm=False,
            )
            model = min(model, rival, key=lambda candidate: candidate.loss)
    return model


def neighbouring_delays(data: Data, model: Model, orders: Orders) -> Model:
    """Try each channel's delay earlier and later by the exact fit.

    A leading coefficient that the data cannot tell from zero counts as delay: of delays that
    fit equally well (within ``DELAY_MARGIN``) the longest is kept.
    """
    for i, y in enumerate(data.y):
        for j in range(len(data.u)):
            for shift, margin in ((-1, -DELAY_MARGIN), (1, DELAY_MARGIN)):
                best = model.fits[i].loss
                while True:
                    row = list(model.delays[i])
                    row[j] += shift
                    if not data.delay[0] <= row[j] <= data.delay[1]:
                        break
                    fit = fit_output(y, model.stems, tuple(row), orders)
                    if fit.loss > best + margin:
                        break
                    best = min(best, fit.loss)
                    delays, fits = list(model.delays), list(model.fits)
                    delays[i], fits[i] = tuple(row), fit
                    model = dataclasses.replace(model, delays=tuple(delays), fits=tuple(fits))
    return model


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
        failures = failures + 1 if best.loss > before - 1.0 else 0
        if failures == PATIENCE:
            break
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
