"""The best figures of one candidate: a grid simulated at once, then ever smaller grids."""

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np

from stiction_ros.deferred import halton_sequence
from stiction_ros.discrepancy.candidate.base import Candidate, Response
from stiction_ros.discrepancy.candidate.valve import StictionCandidate
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.misfit import misfit, settled
from stiction_ros.discrepancy.likelihood.declared_noise import behind_lag
from stiction_ros.discrepancy.likelihood.noise import (
    Blocks,
    NoiseFit,
    best_noise,
    noise_forms,
    shared_factors,
)
from stiction_ros.discrepancy.measures import FINE_ROUNDS, ROUNDS, SETTLED, SIDES, SURE, TRIED
from stiction_ros.effects import Behaviour, FloatArray

SLOW = np.array([0.8])
SHRINK = 0.4
BRED = 100  # points of a needle that breed: so, 8 of 8 starts ended alike in each of 5 searches
GENERATIONS = 160  # how often they breed; 300 points and 40 times failed in up to 3 of 8 starts
BOXES = tuple(0.6**k for k in range(FINE_ROUNDS))  # around the best point, of the largest
THROWN = 15 * BRED  # points in a box: with 300, one of 4 starts ended short
FAIR = 3  # rounds after which a start that is surely behind is given up
NO_MEMORY = np.zeros(0)

Under = Mapping[int, FloatArray]  # φ of an output's noise


@dataclasses.dataclass(frozen=True)
class CandidateFit:
    """One candidate at its best."""

    candidate: Candidate  # which
    point: FloatArray  # searched figures, shape (axes,)
    factors: FloatArray  # figures found by least squares, shape (s,)
    noise: Mapping[int, NoiseFit]  # per output that it touches, the noise that is left
    # by how much it beats the current model alone on the training rows; negative when it does not
    delta_bic: float
    # −2 log likelihood that it gains on the held-out rows, with the figures of the training rows
    held_gain: float

    @property
    def evidence(self) -> float:
        """By how much it beats the current model on all rows: fitted ones and foretold ones."""
        return self.delta_bic + self.held_gain

    @property
    def behaviour(self) -> Behaviour | None:
        """The effect with its figures; None outside the catalogue."""
        return self.candidate.behaviour(self.point, self.factors)


def fit_candidate(
    base: Baseline, gap: FloatArray, candidate: Candidate, around: FloatArray | None = None
) -> CandidateFit:
    """Return the best figures of a candidate by the likelihood of the innovations.

    Args:
        base: of the current model.
        gap: what is to be explained, shape (N, p).
        candidate: the change.
        around: a point near which alone is searched, shape (axes,), values; None everywhere.
    """
    search = _Search(base, gap, candidate)
    if around is None:
        centres = search.coarse()[:TRIED]
    else:
        search.judge(around, candidate.respond(base.run, around[None, :]))
        centres = [candidate.coordinates(around)]
    for centre in centres:
        search.refine(centre, 0.7)
    if candidate.sharp and around is None:
        for ar, centre in search.blurred:
            search.refine(centre, 0.7, ar)
    if candidate.needle and around is None and search.best().delta_bic > 0.0:
        search.breed()
    if candidate.dated:
        if len(candidate.axes) > 1:
            search.polish()
        return search.exact(_dated(search))
    search.polish()
    return search.exact(search.best())


def _dated(search: "_Search") -> CandidateFit:
    """Return the best fit with its moment found on all rows, the held-out ones included.

    A moment within a held-out block leaves no other trace than before and after it. Asked are the
    samples of two blocks on either side.
    """
    base, found = search.base, search.best()
    every = tuple(Blocks(b.scored, np.zeros_like(b.held), b.measured) for b in base.blocks)
    whole = _Search(dataclasses.replace(base, blocks=every), search.gap, search.candidate)
    axis, runs = search.candidate.axes[0], base.run.runs
    near = np.abs(runs.time - found.point[0]) <= 2 * runs.block * runs.sample_time
    moments = np.unique(np.clip(runs.time[near], axis.low, axis.high))
    values = np.tile(found.point, (len(moments), 1))
    values[:, 0] = moments
    response = search.candidate.respond(base.run, values)
    best = whole.best_of(values, response, [found.noise, base.noise])
    other = search.judge(best, search.candidate.respond(base.run, best[None, :]))
    return max(*search.judged.values(), other, key=lambda fit: fit.evidence)


class _Search:
    """The state of one search: the best point so far, judged by the exact likelihood."""

    def __init__(self, base: Baseline, gap: FloatArray, candidate: Candidate) -> None:
        self.base, self.gap, self.candidate = base, gap, candidate
        self.found: CandidateFit | None = None
        self.judged: dict[tuple[float, ...], CandidateFit] = {}
        # the best points of the first grid under noises that blur sharp peaks, and these noises
        self.blurred: list[tuple[Under, FloatArray]] = []

    def coarse(self) -> list[FloatArray]:
        """Return the best points of the first grid, under several guesses of the noise."""
        grid = self.candidate.grid()
        values = self.candidate.values(grid)
        response = self.candidate.respond(self.base.run, values)
        plausible = {i: self.base.plausible[i] for i in response.outputs}
        blurring: list[Under] = [dict.fromkeys(response.outputs, NO_MEMORY)]
        blurring += [plausible for _ in range(any(map(len, plausible.values())))]
        blurs = [misfit(self.base, self.gap, response, ar) for ar in blurring]
        for ar, squares in zip(blurring, blurs, strict=True):
            best = self.candidate.apart(grid, squares, TRIED)
            self.blurred += [(ar, grid[k]) for k in best]
        guesses: list[Under] = [
            {i: self.base.noise[i].searched for i in response.outputs},
            dict.fromkeys(response.outputs, SLOW),
        ]
        leaders: dict[int, float] = {}
        before: CandidateFit | None = None
        for _ in range(3):
            tried = [misfit(self.base, self.gap, response, ar) for ar in guesses]
            if before is None:
                tried += blurs
            for squares in tried:
                for point in self.candidate.apart(grid, squares, TRIED):
                    if point not in leaders:
                        fit = self.judge(values[point], response.pick(point))
                        leaders[point] = fit.delta_bic
            if self.best() is before:  # its noise has been a guess
                break
            before = self.best()
            guesses = [{i: fit.searched for i, fit in before.noise.items()}]
        order = sorted(leaders, key=lambda point: -leaders[point])
        return [grid[point] for point in order]

    def refine(self, centre: FloatArray, size: float, under: Under | None = None) -> None:
        """Search smaller and smaller grids, the first of ``size`` of its steps, around a point.

        Their points are compared ``under`` a noise, None for that of the best one so far.
        """
        if not self.candidate.axes:
            self._try(self.candidate.grid())
            return
        best = self._try(np.array([centre]), self.found, under)
        for done in range(ROUNDS):
            if done >= FAIR and best[1].delta_bic < self.best().delta_bic - SURE:
                break
            best = self._around(best, size, under, done >= FAIR - 1)  # first by the start's noise
            size *= SHRINK

    def polish(self) -> None:
        """Search on around the best point until smaller grids gain next to nothing."""
        if not self.candidate.axes or self.best().delta_bic <= 0.0:
            return
        best = self.candidate.coordinates(self.best().point), self.best()
        size = 0.7 * SHRINK**ROUNDS
        for _ in range(FINE_ROUNDS):
            better = self._around(best, size)
            if better[1].delta_bic < best[1].delta_bic + SETTLED:
                size *= SHRINK
            best = better

    def _around(
        self,
        best: tuple[FloatArray, CandidateFit],
        size: float,
        under: Under | None = None,
        judged: bool = True,
    ) -> tuple[FloatArray, CandidateFit]:
        """Return the best of a grid around a point and that point, with its coordinates."""
        axes = self.candidate.axes
        steps = np.array([axis.spacing for axis in axes])
        offsets = np.array(list(itertools.product(*[(0.0,) if a.linear else SIDES for a in axes])))
        found = self._try(best[0] + offsets * (size * steps), best[1], under, judged)
        return found if under is not None or found[1].delta_bic >= best[1].delta_bic else best

    def breed(self) -> None:
        """Search all figures of a needle by differential evolution, then in ever smaller boxes.

        The optimum of He's law is a needle in a valley: stems that differ in one slip differ
        for long. Points of a lattice miss it however fine they are along the valley, and far from
        it nothing leads there. The boxes are around the best point so far; the start of a stem is
        left open in all of them: one that is wrong hides the rest.
        """
        needle, run = self.candidate, self.base.run
        assert isinstance(needle, StictionCandidate)

        def losses_of(cubes: FloatArray) -> FloatArray:
            response = needle.respond(run, needle.of_cube(cubes))
            return misfit(self.base, self.gap, response, ar)

        random = np.random.default_rng(0)
        halton = halton_sequence(len(needle.cube(self.best().point)), seed=0)
        white = dict.fromkeys(range(len(self.base.noise)), NO_MEMORY)
        for under in (white, None):  # None: under the noise of the best fit so far
            leading = sorted(self.judged.values(), key=lambda fit: -fit.delta_bic)[:TRIED]
            cubes = halton.random(BRED)
            cubes[: len(leading)] = [needle.cube(fit.point) for fit in leading]
            ar = under or self._searched(self.found)
            losses = losses_of(cubes)
            for _ in range(GENERATIONS):
                tried = _bred(cubes, random)
                found = losses_of(tried)
                better = found <= losses
                cubes[better], losses[better] = tried[better], found[better]
            best = needle.of_cube(cubes[[int(np.argmin(losses))]])
            self.judge(best[0], needle.respond(run, best))
        for size in BOXES:
            fit = self.best()
            values = needle.box(fit.point, halton.random(THROWN), size)
            response = needle.respond(run, values)
            self.best_of(values, response, [fit.noise, self.base.noise])
            self._judge_best(values, response, dict.fromkeys(response.outputs, NO_MEMORY))

    def _searched(self, like: CandidateFit | None) -> dict[int, FloatArray]:
        """Return φ under which points are compared: of a fit, where it has any."""
        own = dict(enumerate(self.base.noise)) | dict({} if like is None else like.noise)
        return {i: noise.searched for i, noise in own.items()}

    def best(self) -> CandidateFit:
        """Return the best fit that was seen."""
        assert self.found is not None
        return self.found

    def best_of(
        self,
        values: FloatArray,
        response: Response,
        guesses: Sequence[Mapping[int, NoiseFit] | Sequence[NoiseFit]],
    ) -> FloatArray:
        """Return the best of several points, each the best one under one guess of the noise."""
        fits = [
            self._judge_best(values, response, {i: noise[i].searched for i in response.outputs})
            for noise in guesses
        ]
        return max(fits, key=lambda fit: fit.delta_bic).point

    def _judge_best(
        self, values: FloatArray, response: Response, ar: Mapping[int, FloatArray]
    ) -> CandidateFit:
        best = int(np.argmin(misfit(self.base, self.gap, response, ar)))
        return self.judge(values[best], response.pick(best))

    def _try(
        self,
        coordinates: FloatArray,
        like: CandidateFit | None = None,
        under: Under | None = None,
        judged: bool = True,
    ) -> tuple[FloatArray, CandidateFit]:
        """Return the best point of a grid under the noise of a fit, or a given one, and its fit.

        Where it is not judged, it keeps the fit whose noise it was found under.
        """
        ar = self._searched(like) | dict(under or {})
        coordinates, response = settled(self.base, self.gap, self.candidate, coordinates, ar)
        alone = len(coordinates) == 1
        best = 0 if alone else int(np.argmin(misfit(self.base, self.gap, response, ar)))
        if not judged and like is not None:
            return coordinates[best], like
        values = self.candidate.values(coordinates[[best]])
        fit = self.judge(values[0], self.candidate.respond(self.base.run, values))
        return coordinates[best], fit

    def judge(self, values: FloatArray, response: Response) -> CandidateFit:
        """Return the fit at one point of the search; the best one is remembered."""
        key = tuple(values.tolist())
        if key in self.judged:
            return self.judged[key]
        fit = self._fit(values, response, rounded=False)
        self.judged[key] = fit
        if self.found is None or fit.delta_bic > self.found.delta_bic:
            self.found = fit
        return fit

    def exact(self, fit: CandidateFit) -> CandidateFit:
        """Return a fit by the likelihood of rounded values, where an output is rounded."""
        if not any(self.base.run.runs.quanta):
            return fit
        response = self.candidate.respond(self.base.run, fit.point[None, :])
        return self._fit(fit.point, response, rounded=True)

    def _fit(self, values: FloatArray, response: Response, rounded: bool) -> CandidateFit:
        factors = np.zeros(0)
        if response.possible is not None and not response.possible.any():  # no point is
            unmoved = {i: self.base.noise[i] for i in response.outputs}
            return CandidateFit(self.candidate, values, factors, unmoved, -np.inf, 0.0)
        noise = {i: self._noise(i, response, values, None, rounded) for i in response.outputs}
        if response.sizes:
            own = {i: sizes[:, 0] for i, sizes in response.sizes.items()}
            first = next(iter(own))
            factors = noise[first].coefficients[: own[first].shape[1]]
            if len(own) > 1:
                factors = shared_factors(own, self.base.columns, noise, self.base.blocks)
                noise = {
                    i: self._noise(i, response, values, factors, rounded) for i in response.outputs
                }
        rows = max(2, sum(self.base.noise[i].rows for i in response.outputs))
        gained, held = -self.candidate.count(values) * math.log(rows), 0.0
        before = self.base.noise if rounded else self.base.plain
        for i, left in noise.items():
            gained += before[i].bic(0) - left.bic(0)
            held += before[i].held_minus_two_log - left.held_minus_two_log
        return CandidateFit(self.candidate, values, factors, noise, gained, held)

    def _noise(
        self,
        i: int,
        response: Response,
        values: FloatArray,
        factors: FloatArray | None,
        rounded: bool,
    ) -> NoiseFit:
        """Return what a response leaves of an output, its factors given or open."""
        columns, target = self.base.columns[i], self.gap[:, i]
        if i in response.shifts:
            target = target - response.shifts[i][:, 0]
        if i in response.sizes:
            sizes = response.sizes[i][:, 0]
            if factors is None:
                columns = np.hstack([sizes, columns])
            else:
                target = target - sizes @ factors
        forms = self.base.declared[i]
        keep = self.candidate.keeps(self.base.run, values)
        if forms and keep is not None:  # what slows PV may or may not slow its noise
            forms = (*forms, *(behind_lag(ar, keep) for ar in forms))
        blocks = self.base.blocks[i]
        fits = noise_forms(target, columns, blocks, (None, self.base.noise[i].ar), forms)
        return best_noise(fits, self.base.run.runs.quanta[i] if rounded else 0.0, blocks)


def _bred(cubes: FloatArray, random: np.random.Generator) -> FloatArray:
    """Return the next points of a differential evolution (rand/1/bin), shape (G, 3).

    Scale .5 to 1, crossover .7: those of SciPy, whose loop over the points takes most of its time.
    """
    first, second, third = cubes[random.integers(len(cubes), size=(3, len(cubes)))]
    tried = first + random.uniform(0.5, 1.0) * (second - third)
    tried = np.where((tried < 0.0) | (tried > 1.0), random.random(tried.shape), tried)
    crossed = random.random(tried.shape) < 0.7
    crossed[np.arange(len(tried)), random.integers(tried.shape[1], size=len(tried))] = True
    return np.where(crossed, tried, cubes)
