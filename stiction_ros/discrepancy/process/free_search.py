"""The best figures of a valve's candidate, the process fitted anew behind every stem."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from stiction_ros.discrepancy.candidate.base import figures_of
from stiction_ros.discrepancy.candidate.valve import ValveCandidate
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.fit.uncertainty import SMOOTH, Intervals
from stiction_ros.discrepancy.likelihood.noise import NoiseFit
from stiction_ros.discrepancy.process.free_equation import Equation, Fitted, best_fit, filtered_fits
from stiction_ros.discrepancy.process.refit import equations_of, problems_of
from stiction_ros.discrepancy.process.stem_scan import Prefilter, StemScan
from stiction_ros.effects.behaviour import BoolArray, FloatArray

WORK = 3_000_000  # samples of all stems of a first grid together
BATCH = 160_000
LEADERS = 3  # per prefilter
CENTRES = 3
FREE_SEARCH_ROUNDS = 4
SHRINK = 0.35
SIDE = (-1.0, -0.5, 0.0, 0.5, 1.0)
ROUGH, FINE = 3, 8  # rounds of Gauss-Newton
HOPELESS = 60.0  # BIC behind the leader beyond which no further point is refined


@dataclasses.dataclass(frozen=True)
class Behind:
    """One point of a candidate with the best process behind it.

    Attributes:
        coordinates: of the search, shape (axes,).
        point: values, shape (axes,).
        fits: per output.
        gain: BIC by which it beats the current model.
    """

    coordinates: FloatArray
    point: FloatArray
    fits: tuple[Fitted, ...]
    gain: float

    @property
    def equations(self) -> list[Equation]:
        """The equation of every output."""
        return [fit.equation for fit in self.fits]


class FreeSearch:
    """The search of one valve's candidate; the process is eliminated at every point."""

    def __init__(self, base: Baseline, candidate: ValveCandidate, longest: int) -> None:
        """Take the current model, the candidate, and the longest delay tried, samples."""
        self.base, self.run, self.candidate = base, base.run, candidate
        self.delays = range(longest + 1)
        self.problems = problems_of(self.run)
        self.own = equations_of(self.run.model)

    def best(self, rival: float = 0.0) -> Behind | None:
        """Return the best point; None where no process behind it is stable.

        Args:
            rival: gain of another candidate; one that begins far behind it is searched less.
        """
        grid = self._grid()
        seeds = self._seeds(grid)
        found = [f for f in (self._exact(*seed) for seed in seeds) if f is not None]
        found.sort(key=lambda each: -each.gain)
        if not found:
            return None
        top = found[0].gain
        near = [f for f in self._apart(found) if f.gain > max(top, rival) - HOPELESS]
        near = near or found[:1]
        return max((self._refined(f) for f in near), key=lambda each: each.gain)

    def loss_near(self, coordinates: FloatArray, noise: Mapping[int, NoiseFit]) -> FloatArray:
        """Return −2 log likelihood but for a constant, shape (G,), under a given noise.

        Args:
            coordinates: of the search, shape (G, axes).
            noise: per output that the valve acts on.
        """
        filters = [
            Prefilter.of(own, noise[i].ar if i in noise else None) for i, own in enumerate(self.own)
        ]
        loss = self._scan(self._stems(coordinates), filters, self.own)[0]
        return np.where(self._possible(coordinates), loss, np.inf)

    def _grid(self) -> FloatArray:
        """Return the first grid in coordinates, thinned where the record is long."""
        grid = self.candidate.grid()
        grid = grid[self._possible(grid)]
        most = max(WORK // len(self.run.runs), 100)
        return grid[:: -(-len(grid) // most)]

    def _seeds(self, grid: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Return coordinates and delays, shape (p,), that one of three criteria favours."""
        noise = self.base.noise
        stems = self._stems(grid)
        seeds: dict[int, FloatArray] = {}
        for prefilters in (
            [Prefilter.of() for _ in self.own],
            [Prefilter.of(own) for own in self.own],
            [Prefilter.of(own, n.ar) for own, n in zip(self.own, noise, strict=True)],
        ):
            loss, delays = self._scan(stems, prefilters, self.own)
            for place in self.candidate.apart(grid, loss, LEADERS):
                seeds.setdefault(place, delays[place])
        return [(grid[place], delay) for place, delay in seeds.items()]

    def _stems(self, coordinates: FloatArray) -> FloatArray:
        return self.candidate.stems(self.run, self.candidate.values(coordinates))

    def _possible(self, coordinates: FloatArray) -> BoolArray:
        return self.candidate.possible(self.candidate.values(coordinates))

    def _scan(
        self, stems: FloatArray, prefilters: Sequence[Prefilter], own: Sequence[Equation]
    ) -> tuple[FloatArray, FloatArray]:
        """Return Σ n log SE over the outputs, shape (G,), and the delays, shape (G, p)."""
        valve = self.candidate.valve
        count = stems.shape[1]
        loss, delays = np.zeros(count), np.zeros((count, len(own)), dtype=int)
        size = max(BATCH // len(stems), 1)
        for i, (problem, equation) in enumerate(zip(self.problems, own, strict=True)):
            if not len(equation.b[valve]):
                continue
            scan = StemScan(problem, equation, valve, self.delays, prefilters[i])
            for first in range(0, count, size):
                part = slice(first, first + size)
                energy = scan.energy(stems[:, part])
                delays[part, i] = energy.argmin(axis=1)
                loss[part] += scan.rows * np.log(energy.min(axis=1))
        return loss, delays

    def _apart(self, found: Sequence[Behind]) -> list[Behind]:
        places = np.array([f.coordinates for f in found])
        order = np.arange(len(found), dtype=float)
        return [found[k] for k in self.candidate.apart(places, order, CENTRES)]

    def _exact(
        self,
        coordinates: FloatArray,
        delays: FloatArray,
        starts: Sequence[Equation] | None = None,
        rounds: int = ROUGH,
    ) -> Behind | None:
        """Return a point with the best process behind it, of given delays."""
        point = self.candidate.values(coordinates[None, :])
        stems = self.run.stems.copy()
        valve = self.candidate.valve
        stems[:, valve] = self.candidate.stems(self.run, point)[:, 0]
        fits = []
        for i, problem in enumerate(problems_of(self.run, stems)):
            late = list(self.own[i].delay)
            late[valve] = int(delays[i])
            own = self.own[i].at(late)
            if starts is None:
                tried = [own, *filtered_fits(problem, own)]
            else:
                tried = [starts[i], starts[i].at(late)][: 1 + (tuple(late) != starts[i].delay)]
            found = best_fit(problem, tried, rounds)
            if found is None:
                return None
            fits.append(found)
        count = self.candidate.count(point[0])
        price = count * float(np.log(max(sum(n.rows for n in self.base.noise), 2)))
        gain = self.base.bic - sum(fit.bic for fit in fits) - price
        return Behind(coordinates, point[0], tuple(fits), gain)

    def _refined(self, best: Behind) -> Behind:
        """Search smaller and smaller grids around a point under the noise of its own fit."""
        steps = np.array([axis.spacing for axis in self.candidate.axes])
        whole = np.array([axis.whole for axis in self.candidate.axes])
        offsets = np.array(list(itertools.product(SIDE, repeat=len(steps))))
        size = 0.7
        for _ in range(FREE_SEARCH_ROUNDS):
            span = np.where(whole, np.maximum(np.rint(size * steps), 1.0), size * steps)
            grid = best.coordinates + offsets * span
            grid = grid[self._possible(grid)]
            prefilters = [Prefilter.of(fit.equation, fit.noise.ar) for fit in best.fits]
            loss, delays = self._scan(self._stems(grid), prefilters, best.equations)
            place = int(np.argmin(loss))
            tried = self._exact(grid[place], delays[place], best.equations, FINE)
            if tried is not None and tried.gain > best.gain:
                best = tried
            size *= SHRINK
        return best


BOX = 9
SCALES = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)  # half widths of the boxes, steps of the first grid


def with_free_process(
    intervals: Intervals, base: Baseline, fit: CandidateFit, longest: int
) -> Intervals:
    """Return the intervals, widened by what another process would allow.

    On boxes of several widths around the fit the process is eliminated at every point, under
    the noise of the fit; points within 3.84 of the least −2 log likelihood belong to the
    interval. Effects elsewhere than in a valve keep their intervals.

    Args:
        intervals: with the process as it is, by parameter.
        base: of the model without the effect, with the process that was fitted behind it.
        fit: the effect.
        longest: delay tried, samples.
    """
    if not isinstance(fit.candidate, ValveCandidate) or not fit.candidate.axes:
        return intervals
    ends = dict(intervals)
    for point in _region(base, fit, fit.candidate, longest):
        behaviour = fit.candidate.behaviour(base.run, point, fit.factors)
        for key, value in figures_of(behaviour).items():
            if key in ends:
                low, high = ends[key]
                ends[key] = (min(low, value), max(high, value))
    return ends


def _region(
    base: Baseline, fit: CandidateFit, candidate: ValveCandidate, longest: int
) -> FloatArray:
    """Return points that the likelihood does not reject, shape (K, axes), values."""
    axes = candidate.axes
    centre = candidate.coordinates(fit.point)
    steps = np.array([axis.spacing if axis.points > 1 else 0.0 for axis in axes])
    free = np.flatnonzero(steps)
    sides = np.meshgrid(*[np.linspace(-1.0, 1.0, BOX)] * len(free), indexing="ij")
    mesh = np.zeros((sides[0].size, len(axes)))
    mesh[:, free] = np.stack([side.ravel() for side in sides], axis=1)
    boxes = [centre + scale * steps * mesh for scale in SCALES]
    grid = np.vstack([centre[None, :], *boxes])
    loss = FreeSearch(base, candidate, longest).loss_near(grid, fit.noise)
    return candidate.values(grid[loss <= loss.min() + SMOOTH])
