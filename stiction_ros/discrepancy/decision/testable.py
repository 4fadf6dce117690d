"""Which effects a record could show: the BIC that an effect of engineering size would gain."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.noise import left_by
from stiction_ros.discrepancy.simulation.free_run import seen_of
from stiction_ros.effects import FloatArray, Offset, ProcessGain
from stiction_ros.signals.autoregression import whiten


@dataclasses.dataclass(frozen=True)
class Testable:
    """Whether one effect of engineering size would be seen.

    Attributes:
        place, effect: as loop models name them.
        expected: BIC that it would gain on this record.
        testable: whether that beats the margin.
        experiment: what would make it testable.
    """

    place: str
    effect: str
    expected: float
    testable: bool
    experiment: str


def testable_effects(
    base: Baseline, candidates: list[Candidate], margin: float
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
    rows = 2
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
    return point if candidate.possible(point).all() else _nearest_possible(candidate, point)


def _nearest_possible(candidate: Candidate, point: FloatArray) -> FloatArray:
    """Return the possible point of the first grid that is nearest, in its steps, (1, axes)."""
    grid = candidate.grid()
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
