"""The frictions that explain a record best: seeds, polish, and what was met on the way.

One function judges, the loss of :mod:`.output_fit`. A seed is only where it is looked at first;
nothing is accepted that is worse than what is known, and everything that was fitted is kept.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.evidence.output_fit import (
    OutputFit,
    Whitened,
    fit_output,
    follow,
    white,
)
from stiction_ros.identification.evidence.problem import Problem
from stiction_ros.identification.friction_grid import coarse_grid, cross_grid, finer_grid
from stiction_ros.identification.scan_kernels import best_apart

SEEDS = 6  # frictions taken from one look at the whole triangle
APART = 0.03  # of the limit, by which they differ
MEMORIES = (0.0, 0.95)  # noise under which the triangle is looked at, beside that of the best
HEADS = 3  # candidates that are polished
STEP = 0.03  # of the limit: first step of the polish
FINEST = 1e-4
SHRINK = 2.5
LINES = 100  # steps along J and S over the limit
BEGINNINGS = (-0.9, -0.6, -0.3, 0.3, 0.6, 0.9)  # of a stem, shares of f_S away from OP
THINNED = 3  # rows of the grid of which one is tried with these
STARTS = 41  # beginnings of a head
MOVES = 6  # of the stem, fewest of a candidate
GAIN = 0.5  # of the loss: a sweep over the valves that gains less is the last
SWEEPS = 3


@dataclasses.dataclass(frozen=True)
class Candidate:
    """Frictions of all valves, and every output under them.

    Attributes:
        friction: rows (f_S, f_D), %, shape (m, 2).
        starts: stem before the first sample minus the first OP, %, shape (m,).
        stems: scaled, shape (m, n).
        fits: one per output.
    """

    friction: FloatArray
    starts: FloatArray
    stems: FloatArray
    fits: tuple[OutputFit, ...]

    @property
    def loss(self) -> float:
        """Sum over the outputs."""
        return float(sum(fit.loss for fit in self.fits))


@dataclasses.dataclass(frozen=True)
class Found:
    """What a search met.

    Attributes:
        best: the candidate of least loss.
        ideal: the best fit without any friction.
        without: per valve, the best fit in which it has no friction and the others theirs.
        met: every candidate, best first.
    """

    best: Candidate
    ideal: Candidate
    without: tuple[Candidate, ...]
    met: tuple[Candidate, ...]


class _Valve:
    """The search over one valve's friction beside given other valves."""

    def __init__(self, problem: Problem, base: Candidate, valve: int) -> None:
        self.problem, self.base, self.valve = problem, base, valve
        self.limit = float(problem.limit[valve])
        self.met: list[Candidate] = []
        self._keys: set[tuple[float, ...]] = set()

    def add(self, row: FloatArray, fits: Sequence[OutputFit], *, whole: bool) -> None:
        """Fit a row (f_S, f_D, start) from neighbouring fits; ``whole`` until nothing changes."""
        key = tuple(round(float(value), 9) for value in row)
        if key in self._keys and not whole:
            return
        self._keys.add(key)
        stems = self.base.stems.copy()
        stems[self.valve] = self.problem.stems(self.valve, row[None, :2], row[2])[0]
        if whole:
            found = tuple(fit_output(self.problem, i, stems, (f,)) for i, f in enumerate(fits))
        else:
            found = tuple(follow(self.problem, i, stems, f) for i, f in enumerate(fits))
        friction, starts = self.base.friction.copy(), self.base.starts.copy()
        friction[self.valve], starts[self.valve] = row[:2], row[2]
        self.met.append(Candidate(friction, starts, stems, found))

    def row_of(self, candidate: Candidate) -> FloatArray:
        """Return (f_S, f_D, start) of this valve."""
        return np.append(candidate.friction[self.valve], candidate.starts[self.valve])

    def look(self, fits: Sequence[OutputFit]) -> None:
        """Take the best of the whole triangle under the noise of ``fits``."""
        grid = coarse_grid(self.limit)
        rows = [np.column_stack([grid, np.zeros(len(grid))])]
        for share in BEGINNINGS:
            away = grid[::THINNED]
            rows.append(np.column_stack([away, share * away[:, 0]]))
        self._take(np.vstack(rows), fits, SEEDS, APART * self.limit)

    def heads(self, count: int, distance: float) -> list[Candidate]:
        """Return the best that was met, frictions apart."""
        met = sorted(self.met, key=lambda one: one.loss)
        return _candidates_apart(met, self.valve, count, distance)

    def settle(self) -> None:
        """Fit the heads until nothing changes, once more from the noise of the best."""
        for head in self.heads(HEADS, APART * self.limit):
            self.add(self.row_of(head), head.fits, whole=True)

    def polish(self) -> None:
        """Look closer and closer round the heads, and along the lines through them."""
        step = STEP * self.limit
        for head in self.heads(HEADS, step):
            self._near(self._lines(head), head, 2, step)
            self._begin(head)
        while step > FINEST * self.limit:
            for head in self.heads(HEADS if step > 0.1 * STEP * self.limit else 1, step):
                centre = head.friction[self.valve][None, :]
                self._near(finer_grid(centre, step / 3.0, self.limit), head, 2, step / 3.0)
            step /= SHRINK
        self._begin(self.heads(1, 0.0)[0])

    def _near(self, grid: FloatArray, head: Candidate, count: int, distance: float) -> None:
        start = np.full(len(grid), head.starts[self.valve])
        self._take(np.column_stack([grid, start]), head.fits, count, distance)

    def _begin(self, head: Candidate) -> None:
        """Try where the stem may have been before the first sample: wherever it had stayed."""
        static = head.friction[self.valve][0]
        starts = static * np.linspace(-1.0, 1.0, STARTS)
        rows = np.column_stack([np.tile(head.friction[self.valve], (STARTS, 1)), starts])
        self._take(rows, head.fits, 1, 0.0)

    def _take(
        self, rows: FloatArray, fits: Sequence[OutputFit], count: int, distance: float
    ) -> None:
        found = losses(self.problem, self.base, self.valve, rows, fits)
        for i in _apart(rows[:, :2], found, count, distance):
            self.add(rows[i], fits, whole=False)

    def _lines(self, head: Candidate) -> FloatArray:
        static, dynamic = head.friction[self.valve]
        jump, band = np.array([static - dynamic]), np.array([static + dynamic])
        return cross_grid(jump, band, self.limit, LINES)


def losses(
    problem: Problem, beside: Candidate, valve: int, rows: FloatArray, fits: Sequence[OutputFit]
) -> FloatArray:
    """Return the loss of many frictions of one valve, infinite where it hardly moves, shape (G,).

    Args:
        problem: the record.
        beside: whose other valves are kept.
        valve: index.
        rows: (f_S, f_D, start), %, shape (G, 3).
        fits: whose noise and prior are taken.
    """
    stems = problem.stems(valve, rows[:, :2], rows[:, 2])
    others = np.delete(beside.stems, valve, axis=0)
    total = np.zeros(len(rows))
    for i, fit in enumerate(fits):
        total += Whitened.of(problem, i, others, fit.noise).under(fit.prior).losses(stems)
    moves = np.count_nonzero(np.diff(stems, axis=1), axis=1)
    return np.where(moves < MOVES, np.inf, total)


def _apart(places: FloatArray, found: FloatArray, count: int, distance: float) -> list[int]:
    """Return the best of ``places``; what lies just at the distance, as in a grid, is too near."""
    beyond = float(np.nextafter(distance, np.inf))
    return [int(i) for i in best_apart(places, found, count, beyond)]


def ideal(problem: Problem, starts: Iterable[Sequence[OutputFit]] = ()) -> Candidate:
    """Return the best fit without friction, from white noise and from ``starts``."""
    stems = problem.ideal_stems()
    begun: list[list[OutputFit | None]] = [[None] for _ in problem.pv]
    for fits in starts:
        for row, fit in zip(begun, fits, strict=True):
            row.append(fit)
    fits = tuple(fit_output(problem, i, stems, row) for i, row in enumerate(begun))
    return Candidate(np.zeros((len(stems), 2)), np.zeros(len(stems)), stems, fits)


def search_valve(problem: Problem, base: Candidate, valve: int) -> list[Candidate]:
    """Return all candidates met in a search over the friction of one valve, best first."""
    looked = _Valve(problem, base, valve)
    looked.look(base.fits)
    for memory in MEMORIES:
        looked.look([white(problem, i, base.stems, memory) for i in range(len(base.fits))])
    if looked.met:
        looked.settle()
        looked.look(looked.heads(1, 0.0)[0].fits)
        looked.polish()
        looked.settle()
    return sorted([base, *looked.met], key=lambda one: one.loss)


def search(problem: Problem) -> Found:
    """Search the frictions of all valves, one after the other, until nothing changes."""
    without = ideal(problem)
    met, best = [without], without
    for _ in range(SWEEPS if len(problem.op) > 1 else 1):
        before = best.loss
        for valve in range(len(problem.op)):
            found = search_valve(problem, best, valve)
            met += found
            best = found[0]
        if best.loss > before - GAIN:
            break
    return _concluded(problem, met)


def search_again(problem: Problem, found: Found, seeds: Sequence[Candidate]) -> Found:
    """Return what is found with frictions that were best elsewhere, as at another rate.

    Args:
        problem: the record.
        found: by :func:`search`.
        seeds: of which frictions and beginnings are tried.
    """
    met, best = list(found.met), found.best
    for valve in range(len(problem.op)):
        tried = _Valve(problem, best, valve)
        for seed in seeds:
            tried.add(tried.row_of(seed), best.fits, whole=True)
        if min((one.loss for one in tried.met), default=np.inf) < best.loss - GAIN:
            tried.polish()
            tried.settle()
        met += tried.met
        best = min([best, *tried.met], key=lambda one: one.loss)
    return found if best is found.best else _concluded(problem, met)


def heads(found: Found, valve: int, count: int, distance: float) -> list[Candidate]:
    """Return the best candidates with friction of a valve, apart by ``distance``, %."""
    met = [one for one in found.met if one.friction[valve, 0] > 0.0]
    return _candidates_apart(met, valve, count, distance)


def _candidates_apart(
    met: Sequence[Candidate], valve: int, count: int, distance: float
) -> list[Candidate]:
    """Return the first of ``met``, best first, whose frictions of a valve are apart."""
    places = np.array([one.friction[valve] for one in met]).reshape(-1, 2)
    ranks = np.arange(len(met), dtype=float)
    return [met[i] for i in _apart(places, ranks, count, distance)]


def _concluded(problem: Problem, met: list[Candidate]) -> Found:
    near = [one.fits for one in sorted(met, key=lambda one: one.loss)[:HEADS]]
    without = ideal(problem, near)
    met = sorted([without, *met], key=lambda one: one.loss)
    return Found(met[0], without, _one_by_one(problem, met, without), tuple(met))


def _one_by_one(
    problem: Problem, met: list[Candidate], without: Candidate
) -> tuple[Candidate, ...]:
    """Return per valve the best candidate without its friction, once fitted for itself."""
    if len(problem.op) == 1:
        return (without,)
    told = []
    for valve in range(len(problem.op)):
        best = met[0]
        friction, starts, stems = best.friction.copy(), best.starts.copy(), best.stems.copy()
        friction[valve], starts[valve] = 0.0, 0.0
        stems[valve] = problem.ideal_stems()[valve]
        fits = tuple(fit_output(problem, i, stems, (None, fit)) for i, fit in enumerate(best.fits))
        known = [one for one in met if not one.friction[valve].any()]
        told.append(min([Candidate(friction, starts, stems, fits), *known], key=lambda c: c.loss))
    return tuple(told)
