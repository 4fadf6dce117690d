"""Step 7: an effect becomes a block of the loop model, or is rolled back."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate
from stiction_ros.discrepancy.decision.decide import FRICTION, borne_out, stem_misfit
from stiction_ros.discrepancy.decision.scores import all_candidates
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.search import CandidateFit, fit_candidate
from stiction_ros.discrepancy.likelihood.noise import NoiseFit
from stiction_ros.discrepancy.simulation.free_run import FreeRun, Runs
from stiction_ros.effects import Behaviour, FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.signals.holds import stretches

EXTENSION_ROUNDS = 2
GROWN = 2.0  # standard errors by which the free-run error of the held-out blocks may grow
WORTH = 10.0
TANGENT = 0.25  # steps of a search, by which figures are varied to see what they would do


@dataclasses.dataclass(frozen=True)
class AddedEffect:
    """One effect that became part of the model."""

    fit: CandidateFit  # its last fit, with every other added effect in place
    behaviour: Behaviour  # with its figures
    # places and effects that the record does not tell from it
    alternatives: tuple[tuple[str, str], ...]

    @property
    def place(self) -> str:
        """Where it acts."""
        return self.fit.candidate.place

    @property
    def effect(self) -> str:
        """What it is."""
        return self.fit.candidate.effect


@dataclasses.dataclass(frozen=True)
class Extension:
    """The model after one more effect."""

    added: tuple[AddedEffect, ...]  # all effects that stayed
    base: Baseline  # of the model with them
    kept: bool  # whether the last effect stayed
    reason: str  # why it did not


def extend(
    bare: LoopModel,
    runs: Runs,
    added: Sequence[AddedEffect],
    new: AddedEffect,
    base: Baseline,
    *,
    lent: bool = False,
) -> Extension:
    """Add an effect, fit all added effects together, and see whether the gap has shrunk.

    Args:
        bare: the model without any added effect.
        runs: the records.
        added: effects of earlier looks.
        new: the one to be added.
        base: of the model with ``added``.
        lent: whether it is added for a while, though the held-out rows refuse it.
    """
    effects = refit_together(bare, runs, [*added, new])
    worth = [e for e in effects if e is effects[-1] or e.fit.delta_bic >= WORTH]
    after_base = base_with(bare, runs, worth)
    trouble = ""
    if not (lent or held_rows_bear_out(base, after_base, dated=new.fit.candidate.dated)):
        trouble = "the innovations of the held-out rows do not become smaller"
    trouble = trouble or _stem_trouble(base, after_base, new.place)
    if trouble:
        return Extension(tuple(added), base, False, trouble)
    return Extension(tuple(worth), after_base, True, "")


def told_already(added: Sequence[AddedEffect], fit: CandidateFit) -> bool:
    """Tell whether a fit is one more friction or curve of a valve that has one already.

    Laws tell one thing in several ways: the second one mends the figures of the first.
    """
    new = fit.candidate
    return any(
        each.place == new.place
        and (
            (new.curved and each.fit.candidate.curved)
            or each.fit.candidate.about.family == FRICTION == new.about.family
        )
        for each in added
    )


def refit_together(
    bare: LoopModel, runs: Runs, effects: Sequence[AddedEffect]
) -> list[AddedEffect]:
    """Return effects, each fitted again behind the others."""
    fitted = list(effects)
    for _ in range(EXTENSION_ROUNDS if len(fitted) > 1 else 1):
        fitted = [_refit(bare, runs, fitted, k) for k in range(len(fitted))]
    return fitted


def run_with(bare: LoopModel, runs: Runs, effects: Sequence[AddedEffect]) -> FreeRun:
    """Return the free run with effects at the end of their chains.

    Every sticky stem starts where the fit puts it.
    """
    model, leads = bare, {}
    for effect in effects:
        model = model.with_effect(effect.place, effect.behaviour)
        kind, _, tag = effect.place.partition(":")
        if kind == "valve":
            leads[tag] = effect.fit.candidate.lead(effect.fit.point)
    return FreeRun(model, runs, leads)


def base_with(bare: LoopModel, runs: Runs, effects: Sequence[AddedEffect]) -> Baseline:
    """Return the baseline of a model with effects, its noise also begun at that of each fit."""
    return Baseline.of(run_with(bare, runs, effects), like=_noises(effects))


def base_beside(bare: LoopModel, runs: Runs, others: Sequence[AddedEffect]) -> Baseline:
    """Return the baseline of a model with effects, their linear figures left open.

    A drift, a sine or a gain that was found beside something that was not yet in the model is
    a little wrong; what comes next is fitted together with it.
    """
    run = run_with(bare, runs, others)
    return Baseline.of(run, columns=open_columns(run, others), like=_noises(others))


def left_open(
    base: Baseline, added: Sequence[AddedEffect], slopes: Sequence[FloatArray] = ()
) -> Baseline:
    """Return the baseline of added effects with all linear figures left open.

    Args:
        base: of the model with the effects.
        added: the effects.
        slopes: per output what else is left open, shape (N, q): other figures of the effects, or of
            a process that was changed.
    """
    if not slopes and not any(effect.fit.candidate.factors for effect in added):
        return base
    columns = open_columns(base.run, added)
    if slopes:
        columns = [np.hstack(pair) for pair in zip(columns, slopes, strict=True)]
    return Baseline.of(base.run, columns=columns, like=_noises(added))


def _noises(effects: Sequence[AddedEffect]) -> list[Mapping[int, NoiseFit]]:
    return [each.fit.noise for each in effects]


def open_columns(run: FreeRun, added: Sequence[AddedEffect]) -> list[FloatArray]:
    """Return per output the free columns and those of linear figures, shape (N, q)."""
    columns = list(run.free)
    for effect in added:
        candidate, point = effect.fit.candidate, effect.fit.point
        if candidate.factors:
            for i, sizes in candidate.respond(run, point[None, :]).sizes.items():
                columns[i] = np.hstack([columns[i], sizes[:, 0]])
    return columns


def tangents(bare: LoopModel, runs: Runs, added: Sequence[AddedEffect]) -> list[FloatArray]:
    """Return per output what added effects would do by figures a little larger, shape (N, q).

    What is not yet in the model has pulled them: what comes next is fitted together with them.
    """
    columns = [np.zeros((len(runs), 0)) for _ in bare.outputs]
    for k, effect in enumerate(added):
        candidate, point = effect.fit.candidate, effect.fit.point
        if candidate.dated or not len(point):
            continue
        run = run_with(bare, runs, [*added[:k], *added[k + 1 :]])
        own = candidate.coordinates(point)
        steps = TANGENT * np.diag([axis.spacing for axis in candidate.axes])
        points = candidate.values(np.vstack([own + steps, own - steps]))
        response = candidate.respond(run, points)
        for i in response.outputs:
            more, less = np.split(response.moves(i, effect.fit.factors), 2, axis=1)
            columns[i] = np.hstack([columns[i], more - less])
    return columns


def _refit(bare: LoopModel, runs: Runs, effects: list[AddedEffect], k: int) -> AddedEffect:
    """Return effect k fitted again behind all others."""
    base = base_beside(bare, runs, effects[:k] + effects[k + 1 :])
    own = effects[k].fit.candidate
    found = same_candidate(all_candidates(base), own)
    if found is None:
        return effects[k]
    candidate = dataclasses.replace(found, twins=own.twins)
    point = effects[k].fit.point
    fit = fit_candidate(base, base.run.gap, candidate, point if len(point) else None)
    behaviour = fit.behaviour(base.run)
    assert behaviour is not None
    return dataclasses.replace(effects[k], fit=fit, behaviour=behaviour)


def same_candidate(candidates: Sequence[Candidate], wanted: Candidate) -> Candidate | None:
    """Return the candidate of the same identity; None when there is none."""
    return next((each for each in candidates if each.identity == wanted.identity), None)


def held_rows_bear_out(base: Baseline, after_base: Baseline, *, dated: bool) -> bool:
    """Tell whether the held-out rows bear out what lies between two models."""
    return borne_out(base.bic - after_base.bic, after_base.held_gain(base), dated)


def moved_away(base: Baseline, after_base: Baseline) -> bool:
    """Tell whether the squared error of the free run has grown by more than chance.

    Held-out blocks are independent witnesses: their growths, weighed by the innovations, have
    a mean and a standard error.
    """
    growths: list[FloatArray] = []
    for old, new, blocks in zip(base.noise, after_base.noise, base.blocks, strict=True):
        unit = max(old.innovation_std, 1e-300)
        growth = np.where(blocks.held, (new.residual / unit) ** 2 - (old.residual / unit) ** 2, 0.0)
        begins, _ = stretches(blocks.held)
        if len(begins):
            growths.append(np.add.reduceat(growth, begins))
    if not growths:
        return False
    blocks_of_one = min(len(each) for each in growths)
    total = np.sum([each[:blocks_of_one] for each in growths], axis=0)
    if blocks_of_one < 3:
        return float(total.sum()) > 0.0
    return float(total.mean()) > GROWN * float(total.std(ddof=1)) / math.sqrt(blocks_of_one)


def _stem_trouble(base: Baseline, after_base: Baseline, place: str) -> str:
    """Return where the measured stems contradict the effect; empty where they do not.

    A stem speaks of what moves it: an effect elsewhere leaves it, but for the figures of others
    that are fitted again.
    """
    for j, valve in enumerate(base.run.model.valve_names):
        if place != f"valve:{valve}":
            continue
        old = stem_misfit(base.run, j, base.run.stems[:, j])
        if stem_misfit(base.run, j, _from_measured(after_base.run, j)) > old:
            return f"the measured stem of {valve} is further from that effect than without it"
    return ""


def _from_measured(run: FreeRun, valve: int) -> FloatArray:
    """Return the stem of a valve, shape (N,), from where the first record shows it."""
    record, name = run.runs.records[0], run.model.valve_names[valve]
    if record.stem is None:
        return run.stems[:, valve]
    lead = float(record.stem[0, record.valves.index(name)] - run.runs.op[0, valve])
    return FreeRun(run.model, run.runs, {**run.leads, name: lead}).stems[:, valve]
