r"""Search for a law that remembers all its slips: the record is taken in piece by piece.

Under the semi-physical law a small error of f_D or of the stem's start is carried on from slip
to slip, so over a whole record only a needle round the right friction fits at all, and no grid
finds it. Over the first few slips the fit is smooth. So a swarm of rows (f_S, f_D, start) is
spread over the triangle and fitted to the beginning of the record; the best are kept, changed
at random on many scales, and judged on a window that grows until it is the record.

Slips that alternate cannot tell f_S from the start: with δ more of one and δ less of the other
the pattern is the same but for 1 % a slip. So the swarm is changed, and kept apart, along
f_S + start, f_D and f_S − start, much more widely along the last.

A window in which the innovations grow by more than ``BROKEN`` says that the right pattern was
lost; the next, longer first window is tried then. Random numbers have a fixed seed.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.exact.growing_windows import (
    beginning_of_data,
    beginning_of_model,
    sample_of_turn,
    shortest_window,
    window_lengths,
)
from stiction_ros.identification.exact.pattern_search import nearby_delays
from stiction_ros.identification.friction.grid import coarse_grid, even_grid
from stiction_ros.identification.problem.models import (
    Criterion,
    Data,
    DelayRanges,
    Model,
    ValveScan,
    linear_model,
    scan_criteria,
    scan_valve,
    with_valve,
)
from stiction_ros.identification.problem.output_error import Orders

SEED = 20
FIRST_TURNS = (4, 6, 9)
STEPS = 30
LEVELS = 9
KEPT, LEAST_KEPT = 150, 20
CHILDREN = 30
SWARM_ROUNDS = 4
WIDTH, WIDE = 0.03, 0.1
SHRINK = 0.6
DECADES = 1.5
APART, LONG = 0.3, 0.15
BROKEN = 1.6
ALL_DELAYS = 2.0
NEARBY, NEARBY_DECADES = 3000, 6.0


@dataclasses.dataclass
class Swarm:
    """Rows (f_S, f_D, start) that fit the present window best, best first.

    Attributes:
        rows: shape (G, 3), %.
        scan: their loss and delays.
        width: how far children lie off, as a share of the limit.
    """

    rows: FloatArray
    scan: ValveScan
    width: float


def growing_swarm(data: Data, model: Model, orders: Orders, valve: int) -> Model | None:
    """Return the best model found on growing windows; None when the pattern is lost.

    Args:
        model: gives the stems of the other valves.
    """
    samples = data.y.shape[1]
    for turns in FIRST_TURNS:
        first = max(sample_of_turn(data, valve, turns), shortest_window(data, orders))
        if first > samples:
            return None
        found = _grown(data, model, orders, valve, first)
        if found is not None:
            return found
    return None


def _grown(data: Data, model: Model, orders: Orders, valve: int, first: int) -> Model | None:
    samples, limit = data.y.shape[1], float(data.limit[valve])
    generator = np.random.default_rng(SEED)
    window = beginning_of_data(data, first)
    best = linear_model(
        window, orders, beginning_of_model(model, first) if len(data.u) > 1 else None
    )
    swarm = _first_swarm(window, best, orders, valve)
    least = np.inf
    for count in window_lengths(first, samples):
        window = beginning_of_data(data, count)
        ranges = data.delays if count < ALL_DELAYS * first else nearby_delays(data, best, valve)
        kept = max(LEAST_KEPT, int(KEPT * first / count))
        if count > first:
            best = _on_window(window, model, best, orders, valve)
            swarm.scan = _judged(window, best, orders, valve, swarm.rows, ranges)
        for _ in range(SWARM_ROUNDS):
            best = _fitted(window, best, orders, valve, swarm)
            off = _offsets(len(swarm.rows) * CHILDREN, swarm.width, generator)
            rows = np.repeat(swarm.rows, CHILDREN, axis=0) + limit * off
            rows = np.vstack([swarm.rows, _in_triangle(rows, limit)])
            scan = _judged(window, best, orders, valve, rows, ranges)
            swarm = _thinned(rows, scan, kept, swarm.width, limit)
            swarm.width *= SHRINK
        best = min(
            best, _fitted(window, best, orders, valve, swarm), key=lambda candidate: candidate.loss
        )
        mean = float(np.exp(best.loss / sum(fit.count for fit in best.fits)))
        if mean > BROKEN * least:
            return None
        least = min(least, mean)
        swarm.width *= SHRINK ** (2 - SWARM_ROUNDS)
    return best


def _on_window(window: Data, model: Model, best: Model, orders: Orders, valve: int) -> Model:
    """Return the model of a shorter window on a longer one."""
    stems = model.stems[:, : window.u.shape[1]]
    delays = np.array([row[valve] for row in best.delays])
    longer = dataclasses.replace(best, stems=stems)
    return with_valve(
        window, longer, orders, valve, best.friction[valve], float(best.start[valve]), delays
    )


def _first_swarm(window: Data, linear: Model, orders: Orders, valve: int) -> Swarm:
    """Return the best rows of the triangle with several starts, under every criterion."""
    limit = float(window.limit[valve])
    grid = np.vstack([coarse_grid(limit), even_grid(limit, STEPS)])
    shares = np.linspace(-0.9, 0.9, LEVELS)
    rows = np.vstack([np.column_stack([grid, share * grid[:, 0]]) for share in shares])
    scans = scan_criteria(
        window, linear, orders, valve, rows[:, :2], rows[:, 2], tuple(Criterion), window.delays
    )
    apart = limit * np.array([0.02, 0.02, 0.05])
    chosen = [_best_apart(scan.loss, rows / apart, KEPT // 3) for scan in scans]
    both = [index for indices in chosen for index in indices]
    both.sort(key=lambda index: float(scans[0].loss[index]))
    return Swarm(rows[both], _part(scans[0], both), WIDTH)


def _fitted(window: Data, best: Model, orders: Orders, valve: int, swarm: Swarm) -> Model:
    """Return the better of the exact fits of the swarm's two best rows."""
    rivals = [
        with_valve(
            window, best, orders, valve, row[:2], float(row[2]), swarm.scan.delays[i], warm=False
        )
        for i, row in enumerate(swarm.rows[:2])
    ]
    return min(rivals, key=lambda candidate: candidate.loss)


def _judged(
    window: Data, best: Model, orders: Orders, valve: int, rows: FloatArray, ranges: DelayRanges
) -> ValveScan:
    return scan_valve(window, best, orders, valve, rows[:, :2], rows[:, 2], ranges=ranges)


def swarm_round(model: Model, valve: int, limit: float) -> FloatArray:
    """Return rows (f_S, f_D, start) at random round the model's, on six decades of scale, %."""
    generator = np.random.default_rng(SEED)
    centre = np.append(model.friction[valve], model.start[valve])
    rows = centre + limit * _offsets(NEARBY, WIDTH, generator, NEARBY_DECADES)
    return _in_triangle(rows, limit)


def _offsets(
    count: int, width: float, generator: np.random.Generator, decades: float = DECADES
) -> FloatArray:
    """Return random moves of (f_S, f_D, start), shape (count, 3), as shares of the limit.

    Their scales differ by row and by direction.
    """
    scale = 10.0 ** generator.uniform(-decades, 0.0, (3, count))
    used = generator.random((3, count)) < 0.7
    off = generator.standard_normal((3, count)) * scale * used
    total, dynamic, difference = off * np.array([[width], [width], [WIDE]])
    return np.column_stack([0.5 * (total + difference), dynamic, 0.5 * (total - difference)])


def _in_triangle(rows: FloatArray, limit: float) -> FloatArray:
    static = np.clip(rows[:, 0], 1e-9 * limit, limit)
    return np.column_stack(
        [static, np.clip(rows[:, 1], 0.0, static), np.clip(rows[:, 2], -static, static)]
    )


def _thinned(rows: FloatArray, scan: ValveScan, kept: int, width: float, limit: float) -> Swarm:
    """Return the best rows that lie apart from each other."""
    places = np.column_stack(
        [rows[:, 0] + rows[:, 2], rows[:, 1], LONG * (rows[:, 0] - rows[:, 2])]
    )
    chosen = _best_apart(scan.loss, places / (APART * width * limit), kept)
    return Swarm(rows[chosen], _part(scan, chosen), width)


def _best_apart(loss: FloatArray, places: FloatArray, count: int) -> list[int]:
    """Return up to ``count`` best rows, no two nearer than 1 in all coordinates."""
    left = loss.copy()
    chosen: list[int] = []
    for _ in range(count):
        index = int(left.argmin())
        if not np.isfinite(left[index]):
            break
        chosen.append(index)
        left[np.abs(places - places[index]).max(axis=1) < 1.0] = np.inf
    return chosen


def _part(scan: ValveScan, rows: list[int]) -> ValveScan:
    index = np.asarray(rows, dtype=int)
    return ValveScan(scan.grid[index], scan.loss[index], scan.delays[index], scan.moves[index])
