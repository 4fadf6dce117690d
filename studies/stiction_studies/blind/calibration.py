"""How large a score chance alone brings about: the stored threshold of ``stiction gap --quick``."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.decision.decide import confirmed, large_enough
from stiction_ros.discrepancy.decision.scores import all_candidates, score_candidates
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import FloatArray
from stiction_ros.signals.autoregression import coloured
from stiction_studies.blind.loops.generator import blind_loop


@dataclasses.dataclass(frozen=True)
class ChanceScore:
    """The best score of one record in which there is nothing but noise.

    Attributes:
        seed: of the loop whose current model and noise it is drawn from.
        candidates: of the catalogue, that were tried.
        evidence: of the best that the held-out rows bear out and that has a size.
    """

    seed: int
    candidates: int
    evidence: float


def chance_scores(seeds: Sequence[int], draws: int) -> Iterator[ChanceScore]:
    """Yield the best scores of records drawn from the current model and its noise alone.

    The whole search is run on every draw, with its fine grids and its own fits of the noise.

    Args:
        seeds: of single blind loops; whatever is hidden in them counts as noise.
        draws: records per loop.
    """
    for seed in seeds:
        seen, _ = blind_loop(seed)
        runs, _ = open_gate(seen.model, [seen.record])
        base = Baseline.of(FreeRun(seen.model, runs))
        random = np.random.default_rng([seed, draws])
        for _ in range(draws):
            yield _best_of_noise(base, random, seed)


def _best_of_noise(base: Baseline, random: np.random.Generator, seed: int) -> ChanceScore:
    gap = _drawn(base, random)
    drawn = Baseline.of(base.run, gap)
    candidates = [each for each in all_candidates(drawn) if each.inside]
    scores = score_candidates(drawn, tuple(candidates), gap=gap)
    kept = [fit.evidence for fit in scores.fits if confirmed(fit) and large_enough(fit)]
    return ChanceScore(seed, len(candidates), max(kept, default=0.0))


def _drawn(base: Baseline, random: np.random.Generator) -> FloatArray:
    """Return a gap of noise alone, shape (N, p)."""
    columns = []
    for noise in base.noise:
        white = random.standard_normal(len(noise.residual)) * noise.innovation_std
        columns.append(coloured(white, noise.ar))
    return np.column_stack(columns)
