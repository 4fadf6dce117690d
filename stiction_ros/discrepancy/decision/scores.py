"""Step 4: every candidate scored against the current model, which stays as it is."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate
from stiction_ros.discrepancy.candidate.output import decoys, output_candidates
from stiction_ros.discrepancy.candidate.plugged import plugged_candidates
from stiction_ros.discrepancy.candidate.valve import valve_candidates
from stiction_ros.discrepancy.candidate.wave import disturbance_candidates
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.search import CandidateFit, fit_candidate
from stiction_ros.discrepancy.likelihood.least_squares import left_by
from stiction_ros.discrepancy.simulation.free_run import seen_of
from stiction_ros.effects import ExtraDelay, FloatArray, Offset, ProcessGain, TimeShift
from stiction_ros.signals.autoregression import whiten

DATA = "data"  # the place of what is wrong with a record
Progress = Callable[[float], None]


@dataclasses.dataclass(frozen=True)
class Scores:
    """All candidates at their best, the best one first."""

    base: Baseline  # the current model
    candidates: tuple[Candidate, ...]  # what was tried, one entry per behaviour and law
    fits: tuple[CandidateFit, ...]  # one per candidate, sorted by ``delta_bic``

    def of(self, place: str, effect: str) -> CandidateFit | None:
        """Return the best fit of an effect, its twins' included; None when not tried."""
        for fit in self.fits:
            if (place, effect) in fit.candidate.keys:
                return fit
        return None


def all_candidates(base: Baseline, clock_known: bool = False) -> tuple[Candidate, ...]:
    """Return every candidate that these records call for.

    Args:
        base: the current model.
        clock_known: whether the record's clock is shown to be right, so that a longer delay
            is no shift of the record.
    """
    gap = np.column_stack([base.scored(i, noise.residual) for i, noise in enumerate(base.noise)])
    whitened = [base.scored(i, noise.innovations) for i, noise in enumerate(base.noise)]
    found = valve_candidates(base.run) + output_candidates(base.run)
    found += disturbance_candidates(base.run, gap, whitened)
    found += plugged_candidates(base.run, whitened)
    if not clock_known:
        found = [
            each.or_else(DATA, TimeShift.effect) if each.effect == ExtraDelay.effect else each
            for each in found
        ]
    return tuple(found + decoys(base.run))


def score_candidates(
    base: Baseline,
    candidates: tuple[Candidate, ...],
    progress: Progress | None = None,
    beside: Baseline | None = None,
) -> Scores:
    """Return the best figures and the score of every candidate.

    Args:
        base: the current model.
        candidates: what is tried.
        progress: called with the share done.
        beside: the current model with figures of its process left open, which a curve is judged
            against; None where nothing of it was changed.
    """
    fits = []
    for k, candidate in enumerate(candidates):
        against = beside if beside is not None and candidate.curved else base
        fits.append(fit_candidate(against, base.run.gap, candidate))
        if progress is not None:
            progress((k + 1) / len(candidates))
    fits.sort(key=lambda fit: -fit.delta_bic)
    return Scores(base, candidates, tuple(fits))


@dataclasses.dataclass(frozen=True)
class Testable:
    """Whether one effect of engineering size would be seen."""

    place: str  # place, effect: as loop models name them
    effect: str
    expected: float  # BIC that it would gain on this record
    testable: bool  # whether that beats the margin
    experiment: str  # what would make it testable


def testable_effects(
    base: Baseline, candidates: Sequence[Candidate], margin: float
) -> tuple[Testable, ...]:
    """Return for every candidate of the catalogue what it would gain at a size that matters."""
    found: dict[tuple[str, str], Testable] = {}
    for candidate in candidates:
        if not candidate.inside:
            continue
        expected = _expected(base, candidate)
        for name in candidate.keys:
            old = found.get(name)
            if old is None or old.expected < expected:
                hint = candidate.about.experiment
                found[name] = Testable(*name, expected, expected >= margin, hint)
    for valve in base.run.model.valves:
        name = (f"valve:{valve.name}", Offset.effect)
        found[name] = Testable(*name, 0.0, False, Offset.experiment)
    return tuple(found.values())


def _expected(base: Baseline, candidate: Candidate) -> float:
    point = reference_point(base, candidate)
    response = candidate.respond(base.run, point)
    energy = 0.0
    rows = 2.0
    for i in response.outputs:
        noise, blocks = base.noise[i], base.blocks[i]
        wave = np.zeros(len(base.run.runs))
        if i in response.shifts:
            wave = wave + response.shifts[i][:, 0]
        if i in response.sizes:
            wave = wave + _reference_size(candidate, noise.innovation_std, response.sizes[i][:, 0])
        train = blocks.train
        basis = base.basis(i, noise.ar)
        left = left_by(basis, whiten(wave, noise.ar)[train])
        energy += float(left @ left) / max(noise.innovation_std**2, 1e-300)
        rows = max(rows, noise.rows)
    return energy - candidate.count(point[0]) * float(np.log(rows))


def reference_point(base: Baseline, candidate: Candidate) -> FloatArray:
    """Return the searched figures of an effect of engineering size, shape (1, axes)."""
    figures = candidate.reference(seen_of(base.run, candidate.signal(base.run)))
    given = (*figures, *(0.0,) * len(candidate.axes))
    axes = zip(given, candidate.axes, strict=False)
    point = np.array([[float(np.clip(v, axis.low, axis.high)) for v, axis in axes]])
    if candidate.possible(point).all():
        return point
    grid = candidate.grid()  # the possible point of it that is nearest, in its steps
    grid = grid[candidate.possible(candidate.values(grid))]
    steps = np.array([max(axis.spacing, 1e-300) for axis in candidate.axes])
    away = (grid - candidate.coordinates(point[0])) / steps
    return candidate.values(grid[[int(np.argmin((away**2).sum(axis=1)))]])


def _reference_size(candidate: Candidate, std: float, columns: FloatArray) -> FloatArray:
    """Return the wave of a size that matters: a tenth of the gain, or three innovations."""
    if candidate.effect == ProcessGain.effect:
        return np.asarray(0.1 * columns[:, 0])
    span = max(float(np.ptp(columns[:, 0])), 1e-300)
    return np.asarray(columns[:, 0] * (3.0 * std / span))
