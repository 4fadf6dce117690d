"""Candidates scored with the process fitted anew behind each of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate
from stiction_ros.discrepancy.candidate.decoys import Dynamics
from stiction_ros.discrepancy.candidate.valve import ValveCandidate
from stiction_ros.discrepancy.decision.decide import Decision, GapVerdict
from stiction_ros.discrepancy.decision.extend import same_candidate
from stiction_ros.discrepancy.decision.measured_stem import confirmed
from stiction_ros.discrepancy.decision.scores import Progress, Scores, all_candidates
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.search import CandidateFit, fit_candidate
from stiction_ros.discrepancy.process.free_equation import Equation, Fitted, best_fit
from stiction_ros.discrepancy.process.free_search import HOPELESS, FreeSearch
from stiction_ros.discrepancy.process.refit import (
    equations_of,
    problems_of,
    refitted,
    with_equations,
)
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.loop import LoopModel

TURNS = 2
MORE_POLES = 2


@dataclasses.dataclass(frozen=True)
class FreeScores:
    """Scores with a free process.

    Attributes:
        scores: as with a given process.
        models: the refitted model, without the candidate, per place and effect.
    """

    scores: Scores
    models: Mapping[tuple[str, str], LoopModel]


@dataclasses.dataclass(frozen=True)
class _Found:
    """A candidate's fit, and the equations behind it."""

    fit: CandidateFit
    equations: tuple[Equation, ...]


def score_with_free_process(
    base: Baseline,
    candidates: tuple[Candidate, ...],
    longest: int,
    progress: Progress | None = None,
) -> FreeScores:
    """Score every candidate against ``base``, the process fitted again with each of them.

    Args:
        base: of a model whose process has been refitted without any candidate.
        candidates: those that a free process takes up are left out.
        longest: delay tried, samples.
        progress: called with the share done, 0 to 1.
    """
    told = [c for c in candidates if not c.absorbed]
    found: list[_Found] = []
    for k, candidate in enumerate(told):
        rival = max((f.fit.delta_bic for f in found), default=0.0)
        found.append(_fit(base, candidate, longest, max(rival, 0.0)))
        if progress is not None:
            progress((k + 1) / len(told))
    better = _shared(base, found)
    found = [dataclasses.replace(f, fit=_against(f.fit, base, better)) for f in found]
    strangers = _other_dynamics(better)
    capped = [_no_luck(fit) for fit in (*(f.fit for f in found), *strangers)]
    fits = sorted(capped, key=lambda fit: -fit.delta_bic)
    models: dict[tuple[str, str], LoopModel] = {}
    for each in sorted(found, key=lambda f: -f.fit.delta_bic):
        models.setdefault(each.fit.candidate.key, with_equations(better.run.model, each.equations))
    tried = (*told, *(stranger.candidate for stranger in strangers))
    return FreeScores(Scores(better, tried, tuple(fits)), models)


def _no_luck(fit: CandidateFit) -> CandidateFit:
    """Return the fit, what it gains on held-out rows no more than on the fitted ones.

    More than that is the luck of the other process behind it, not the effect's.
    """
    return dataclasses.replace(fit, held_gain=min(fit.held_gain, max(fit.delta_bic, 0.0)))


def in_doubt_of_place(base: Baseline, decision: Decision) -> Decision:
    """Return the decision, a static curve of the valve left in doubt with one of the process.

    A free linear process behind a curve and a curved process behind a linear valve give the
    same record, so that neither may be added. A recorded stem may confirm the curve.
    """
    if decision.chosen is None or not decision.chosen.candidate.about.bends:
        return decision
    if confirmed(base.run, decision.chosen):
        return decision
    _, _, valve = decision.chosen.candidate.place.partition(":")
    names = base.run.model.outputs
    curves = [(f"process:{names[i]}", "gain") for i in sorted(decision.chosen.noise)]
    return dataclasses.replace(
        decision,
        verdict=GapVerdict.AMBIGUOUS,
        alternatives=tuple(dict.fromkeys([*decision.alternatives, *curves])),
        inseparable=False,
        reason=f"a bend between OP of {valve} and PV may be the valve's or the process's",
    )


def _fit(base: Baseline, candidate: Candidate, longest: int, rival: float) -> _Found:
    if isinstance(candidate, ValveCandidate):
        return _fit_valve(base, candidate, longest, rival)
    first = fit_candidate(base, base.run.gap, candidate)
    best = _Found(first, tuple(equations_of(base.run.model)))
    if not candidate.inside or first.delta_bic < rival - HOPELESS:
        return best
    for _ in range(TURNS):
        behaviour = best.fit.behaviour(base.run)
        assert behaviour is not None
        model = with_equations(base.run.model, best.equations)
        run = FreeRun(model.with_effect(candidate.place, behaviour), base.run.runs, base.run.leads)
        equations = tuple(equations_of(refitted(run, longest)))
        again = _scored_behind(base, candidate, equations)
        if again is None or again.fit.delta_bic <= best.fit.delta_bic + 0.1:
            break
        best = again
    return best


def _fit_valve(base: Baseline, candidate: ValveCandidate, longest: int, rival: float) -> _Found:
    best = FreeSearch(base, candidate, longest).best(rival)
    if best is None:
        first = fit_candidate(base, base.run.gap, candidate)
        return _Found(first, tuple(equations_of(base.run.model)))
    other = Baseline.of(_run_behind(base, tuple(best.equations)))
    fit = fit_candidate(other, other.run.gap, candidate, best.point)
    return _Found(_against(fit, other, base), tuple(best.equations))


def _scored_behind(
    base: Baseline, candidate: Candidate, equations: tuple[Equation, ...]
) -> _Found | None:
    """Return a candidate's best fit with these equations behind it."""
    other = Baseline.of(_run_behind(base, equations))
    same = same_candidate(all_candidates(other), candidate)
    if same is None:
        return None
    return _Found(_against(fit_candidate(other, other.run.gap, same), other, base), equations)


def _run_behind(base: Baseline, equations: tuple[Equation, ...]) -> FreeRun:
    return FreeRun(with_equations(base.run.model, equations), base.run.runs, base.run.leads)


def _against(fit: CandidateFit, other: Baseline, base: Baseline) -> CandidateFit:
    """Return a fit that was scored against ``other`` as it stands against ``base``."""
    return dataclasses.replace(
        fit,
        delta_bic=fit.delta_bic - (other.bic - base.bic),
        held_gain=fit.held_gain - base.held_gain(other),
    )


def _shared(base: Baseline, found: list[_Found]) -> Baseline:
    """Return the current model with the best process that any candidate led to.

    The likelihood of a free run has many optima: what helps a candidate may help without it.
    """
    chosen: list[Equation] = []
    for i, (problem, own) in enumerate(
        zip(problems_of(base.run), equations_of(base.run.model), strict=True)
    ):
        best = problem.fit(own)
        for each in found:
            tried = best_fit(problem, [each.equations[i]], 8)
            if tried is not None and tried.bic < best.bic - 1e-6:
                best = tried
        chosen.append(best.equation)
    better = Baseline.of(_run_behind(base, tuple(chosen)))
    return better if better.bic < base.bic else base


def _other_dynamics(base: Baseline) -> list[CandidateFit]:
    """Return per output what more poles than the model has would gain.

    A candidate that gains less than they do is no name: the first model's order is a guess.
    """
    found = []
    for i, (problem, own) in enumerate(
        zip(problems_of(base.run), equations_of(base.run.model), strict=True)
    ):
        now = base.noise[i]
        rivals: list[tuple[float, Fitted]] = []
        start: Equation | None = own
        for poles in range(1, MORE_POLES + 1):
            fitted = None if start is None else best_fit(problem, [start.raised(1)], 12)
            if fitted is None:
                break
            price = poles * float(np.log(max(now.rows, 2)))
            rivals.append((now.bic(0) - fitted.bic - price, fitted))
            start = fitted.equation
        if not rivals:
            continue
        gain, fitted = max(rivals, key=lambda each: each[0])
        held = now.held_minus_two_log - fitted.noise.held_minus_two_log
        none = np.zeros(0)
        found.append(
            CandidateFit(Dynamics.of(base.run, i), none, none, {i: fitted.noise}, gain, held)
        )
    return found
