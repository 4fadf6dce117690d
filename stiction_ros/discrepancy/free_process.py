"""Candidates scored with the process fitted anew behind each of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np

from stiction_ros.discrepancy.candidates import Candidate
from stiction_ros.discrepancy.catalogue_scores import Scores, all_candidates
from stiction_ros.discrepancy.extend import same_candidate
from stiction_ros.discrepancy.free_run import FreeRun, Runs
from stiction_ros.discrepancy.process_refit import refit_process
from stiction_ros.discrepancy.search import Baseline, CandidateFit, fit_candidate
from stiction_ros.effects import FloatArray
from stiction_ros.loop import LoopModel

COARSE_ROUNDS = 3
TURNS = 3
WIDE = 4  # starts behind which all figures are searched again
SPARSE = {"stiction": (9, 4, 1), "backlash": (9, 1), "slew": (7,), "saturation": (4, 4)}
# What another process would do as well cannot be told while the process is free.
ABSORBED = ("lag", "pole", "delay", "gain", "leak", "other dynamics")


@dataclasses.dataclass(frozen=True)
class FreeScores:
    """Scores with a free process.

    Attributes:
        scores: as with a given process.
        models: the refitted model, without the candidate, per place and effect.
    """

    scores: Scores
    models: Mapping[tuple[str, str], LoopModel]


def score_with_free_process(
    model: LoopModel,
    runs: Runs,
    base: Baseline,
    candidates: tuple[Candidate, ...],
    progress: Callable[[float], None] | None = None,
) -> FreeScores:
    """Score every candidate against ``base``, the process fitted again with each of them.

    Args:
        model: whose process has been refitted without any candidate.
        runs: the records.
        base: of ``model``.
        candidates: those that a free process takes up are left out.
    """
    told = [c for c in candidates if c.effect not in ABSORBED]
    fits: list[CandidateFit] = []
    models: dict[tuple[str, str], LoopModel] = {}
    for k, candidate in enumerate(told):
        fit, refitted = _fit(model, runs, base, candidate)
        name = (candidate.place, candidate.effect)
        if name not in models or all(
            f.delta_bic < fit.delta_bic
            for f in fits
            if (f.candidate.place, f.candidate.effect) == name
        ):
            models[name] = refitted
        fits.append(fit)
        if progress is not None:
            progress((k + 1) / len(told))
    base, better = _shared(model, runs, base, models)
    gain = better - base.bic
    fits = [dataclasses.replace(fit, delta_bic=fit.delta_bic - gain) for fit in fits]
    fits.sort(key=lambda fit: -fit.delta_bic)
    return FreeScores(Scores(base, tuple(told), tuple(fits)), models)


def _shared(
    model: LoopModel,
    runs: Runs,
    base: Baseline,
    models: Mapping[tuple[str, str], LoopModel],
) -> tuple[Baseline, float]:
    """Return the current model with the best process that any candidate led to, and its old BIC.

    The likelihood of a free run has many optima: what helps a candidate may help without it.
    """
    before, best = base.bic, base
    for other in {id(m): m for m in models.values() if m is not model}.values():
        tried = Baseline.of(FreeRun(refit_process(other, runs, 8), runs))
        if tried.bic < best.bic:
            best = tried
    return best, before


def _fit(
    model: LoopModel, runs: Runs, base: Baseline, candidate: Candidate
) -> tuple[CandidateFit, LoopModel]:
    first = fit_candidate(base, base.run.gap, candidate)
    if not candidate.inside:
        return first, model
    best = first, model
    tried = []
    for point in _starts(candidate, first):
        own, behind = _behind(model, runs, base, first, point)
        found = _rescored(behind, runs, base, candidate, own)
        if found is not None:
            tried.append((found, behind))
    tried.sort(key=lambda each: -each[0].delta_bic)
    for _, behind in tried[:WIDE]:
        found = _rescored(behind, runs, base, candidate, None)
        tried += [] if found is None else [(found, behind)]
    best = max([best, *tried], key=lambda each: each[0].delta_bic)
    for _ in range(TURNS):
        own, behind = _behind(best[1], runs, base, best[0], best[0].point, 8)
        found = _rescored(behind, runs, base, candidate, None)
        if found is None or found.delta_bic <= best[0].delta_bic + 0.1:
            break
        best = found, behind
    return best


def _starts(candidate: Candidate, first: CandidateFit) -> list[FloatArray]:
    """Return points of a sparse grid, and the best one behind the process as it was."""
    counts = SPARSE.get(candidate.effect)
    if counts is None:
        return [first.point]
    sparse = [
        axis.low + (axis.high - axis.low) * (np.arange(n) + 0.5) / n
        for axis, n in zip(candidate.axes, counts, strict=True)
    ]
    mesh = np.stack([m.ravel() for m in np.meshgrid(*sparse, indexing="ij")], axis=1)
    return [first.point, *mesh]


def _behind(
    model: LoopModel,
    runs: Runs,
    base: Baseline,
    fit: CandidateFit,
    point: FloatArray,
    rounds: int = COARSE_ROUNDS,
) -> tuple[FloatArray, LoopModel]:
    """Return the point and the model, the candidate taken out again, refitted behind it."""
    behaviour = fit.candidate.behaviour(base.run, point, fit.factors)
    assert behaviour is not None
    refitted = refit_process(model.with_effect(fit.candidate.place, behaviour), runs, rounds)
    document = model.to_mapping()
    outputs = refitted.to_mapping()["process"]["outputs"]
    for entry, new in zip(document["process"]["outputs"], outputs, strict=True):
        for key in ("a", "b", "delay"):
            entry[key] = new[key]
    return point, LoopModel.from_mapping(document, model.name)


def _rescored(
    model: LoopModel, runs: Runs, base: Baseline, candidate: Candidate, point: FloatArray | None
) -> CandidateFit | None:
    """Return the candidate's best fit behind a refitted process, against ``base``.

    With a ``point`` only figures near it are searched.
    """
    other = Baseline.of(FreeRun(model, runs))
    same = same_candidate(all_candidates(other), candidate)
    if same is None:
        return None
    fit = fit_candidate(
        other, other.run.gap, same, point if point is not None and len(point) else None
    )
    # The price of the process is paid by both; its worth behind this candidate is not.
    shift = other.bic - base.bic
    held = sum(
        old.held_minus_two_log - new.held_minus_two_log
        for old, new in zip(other.noise, base.noise, strict=True)
    )
    return dataclasses.replace(fit, delta_bic=fit.delta_bic - shift, held_gain=fit.held_gain - held)
