"""An explanation of the records: effects in a model, what of its process is changed, the noise."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stiction_ros.discrepancy.decision.decide import FRICTION
from stiction_ros.discrepancy.decision.scores import all_candidates
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.search import CandidateFit, fit_candidate
from stiction_ros.discrepancy.likelihood.noise import NoiseFit
from stiction_ros.discrepancy.measures import MARGIN, QUARTER, TURNS
from stiction_ros.discrepancy.simulation.free_run import FreeRun, Runs
from stiction_ros.effects import Behaviour, FloatArray
from stiction_ros.loop import LoopModel


@dataclasses.dataclass(frozen=True)
class AddedEffect:
    """One effect that became part of the model."""

    fit: CandidateFit  # its last fit, with every other added effect in place
    # places and effects that the record does not tell from it
    alternatives: tuple[tuple[str, str], ...] = ()
    fits: tuple[CandidateFit, ...] = ()  # of all candidates in its place

    @property
    def place(self) -> str:
        """Where it acts."""
        return self.fit.candidate.place

    @property
    def effect(self) -> str:
        """What it is."""
        return self.fit.candidate.effect

    @property
    def behaviour(self) -> Behaviour:
        """The effect with its figures."""
        found = self.fit.behaviour
        assert found is not None
        return found


@dataclasses.dataclass(frozen=True)
class ProcessChange:
    """One figure of the process that is another than the model says."""

    output: str  # tag
    what: str  # ``gain``, ``time_constant``, ``lead`` (the time constant of a zero) or ``delay``
    # factor of the gain or of a time constant; seconds of dead time beyond the model's, negative
    # for less
    value: float
    interval: tuple[float, float]  # 95 %
    unit: str  # of the value
    model: float | None = None  # the model's own time constant, s; None for the others
    # whether it is as large as matters: 5 %, and half a sample in time, as OP is held so long
    matters: bool = True

    @property
    def sentence(self) -> str:
        """What it says, for people, such as ``dead time 2 s shorter than in the model``."""
        small = "; this is too small to matter, and the model is corrected"
        return self._size + ("" if self.matters else small)

    @property
    def _size(self) -> str:
        low, high = self.interval
        if self.what == "delay":
            side = "longer" if self.value > 0.0 else "shorter"
            low, high = sorted((abs(low), abs(high)))
            said = f"dead time {abs(self.value):.3g} s {side} than in the model"
            return f"{said} (95 % between {low:.3g} and {high:.3g} s)"
        if self.model is None:
            said = f"gain {self.value:.3g} times that of the model"
            return f"{said} (95 % between {low:.3g} and {high:.3g})"
        kind = "lead" if self.what == "lead" else "time constant"
        now, low, high = (self.model * each for each in (self.value, low, high))
        if low <= 0.0:
            return f"no {kind} of {self.model:.3g} s, or one below {high:.3g} s (95 %)"
        said = f"{kind} {now:.3g} s, in the model {self.model:.3g} s"
        return f"{said} (95 % between {low:.3g} and {high:.3g} s)"

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of ``process_changes`` in ``gap --json``."""
        told = dataclasses.asdict(self) | {"interval": list(self.interval)}
        del told["matters"]  # or it is not told
        return told


@dataclasses.dataclass(frozen=True)
class Explanation:
    """Effects of a model, what of its process is another than given, and the noise that is left."""

    bare: LoopModel  # without the effects, its process as it is taken
    base: Baseline  # of the model with them
    effects: tuple[AddedEffect, ...] = ()  # in the order in which they were found
    changes: tuple[ProcessChange, ...] = ()  # what of the process is another than given
    # per output what a unit of each figure that was changed moves, shape (N, q)
    slopes: tuple[FloatArray, ...] = ()

    @classmethod
    def of(
        cls,
        bare: LoopModel,
        runs: Runs,
        effects: Sequence[AddedEffect],
        changes: tuple[ProcessChange, ...] = (),
        slopes: tuple[FloatArray, ...] = (),
    ) -> "Explanation":
        """Return the explanation by effects with their present figures."""
        base = Baseline.of(run_with(bare, runs, effects), like=_noises(effects))
        return cls(bare, base, tuple(effects), changes, slopes)

    @property
    def runs(self) -> Runs:
        """The records end to end."""
        return self.base.run.runs

    @property
    def score(self) -> float:
        """−2 log likelihood of fitted and held-out rows, and the price of the effects' figures."""
        figures = sum(each.fit.candidate.count(each.fit.point) for each in self.effects)
        return self.base.score + figures * self._price

    def worth(self, margin: float) -> float:
        """Return what is to be least: an effect more must gain the margin.

        So must all changes of the process together, each of which has its price in BIC.
        """
        found = self.score + margin * len(self.effects)
        return found + margin + len(self.changes) * self._price if self.changes else found

    @property
    def _price(self) -> float:
        return math.log(max(2, *(fit.rows for fit in self.base.noise)))

    def holding(self, effects: Sequence[AddedEffect]) -> "Explanation":
        """Return the same process with these effects in place of its own."""
        return Explanation.of(self.bare, self.runs, effects, self.changes, self.slopes)

    def refitted(self, effects: Sequence[AddedEffect]) -> "Explanation":
        """Return the same process with these effects, each fitted again behind the others."""
        return self.holding(refit_together(self.bare, self.runs, effects))

    def extended(self, effects: Sequence[AddedEffect]) -> "Explanation":
        """Return the same process with effects fitted together, the last of them a new one.

        What the others explain no longer goes.
        """
        *others, new = refit_together(self.bare, self.runs, effects)
        return self.holding([*(each for each in others if each.fit.delta_bic >= MARGIN), new])

    def tells(self, fit: CandidateFit) -> bool:
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
            for each in self.effects
        )

    def others(self, k: int) -> tuple[AddedEffect, ...]:
        """Return all effects but one."""
        return (*self.effects[:k], *self.effects[k + 1 :])

    def beside(self, k: int) -> Baseline:
        """Return the baseline with all effects but one, their linear figures left open."""
        others = self.others(k)
        return left_open(run_with(self.bare, self.runs, others), others)

    def tangents(self) -> list[FloatArray]:
        """Return per output what the effects would do by figures a little larger, shape (N, q).

        What is not yet in the model has pulled them: what comes next is fitted together with them.
        """
        columns = [np.zeros((len(self.runs), 0)) for _ in self.bare.outputs]
        for k, effect in enumerate(self.effects):
            candidate, point = effect.fit.candidate, effect.fit.point
            if candidate.dated or not len(point):
                continue
            run = run_with(self.bare, self.runs, self.others(k))
            own = candidate.coordinates(point)
            steps = QUARTER * np.diag([axis.spacing for axis in candidate.axes])
            points = candidate.values(np.vstack([own + steps, own - steps]))
            response = candidate.respond(run, points)
            for i in response.outputs:
                more, less = np.split(response.moves(i, effect.fit.factors), 2, axis=1)
                columns[i] = np.hstack([columns[i], more - less])
        return columns


def refit_together(
    bare: LoopModel, runs: Runs, effects: Sequence[AddedEffect]
) -> list[AddedEffect]:
    """Return effects, each fitted again behind the others."""
    fitted = list(effects)
    for _ in range(TURNS if len(fitted) > 1 else 1):
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
            leads[tag] = float(effect.fit.candidate.lead(effect.fit.point[None, :])[0])
    return FreeRun(model, runs, leads)


def left_open(
    run: FreeRun, effects: Sequence[AddedEffect], slopes: Sequence[FloatArray] = ()
) -> Baseline:
    """Return the baseline of a run with effects, their linear figures left open.

    A drift, a sine or a gain that was found beside something that was not yet in the model is
    a little wrong; what comes next is fitted together with it.

    Args:
        run: of the model with the effects.
        effects: that it has.
        slopes: per output what else is left open, shape (N, q): other figures of the effects, or of
            a process that was changed.
    """
    columns = open_columns(run, effects)
    if slopes:
        columns = [np.hstack(pair) for pair in zip(columns, slopes, strict=True)]
    return Baseline.of(run, columns=columns, like=_noises(effects))


def open_columns(run: FreeRun, effects: Sequence[AddedEffect]) -> list[FloatArray]:
    """Return per output the free columns and those of linear figures, shape (N, q)."""
    columns = list(run.free)
    for effect in effects:
        candidate, point = effect.fit.candidate, effect.fit.point
        if candidate.factors:
            for i, sizes in candidate.respond(run, point[None, :]).sizes.items():
                columns[i] = np.hstack([columns[i], sizes[:, 0]])
    return columns


def _noises(effects: Sequence[AddedEffect]) -> list[Mapping[int, NoiseFit]]:
    return [each.fit.noise for each in effects]


def _refit(bare: LoopModel, runs: Runs, effects: list[AddedEffect], k: int) -> AddedEffect:
    """Return effect k fitted again behind all others."""
    others = effects[:k] + effects[k + 1 :]
    base = left_open(run_with(bare, runs, others), others)
    own = effects[k].fit.candidate
    found = next((each for each in all_candidates(base) if each.name == own.name), None)
    if found is None:
        return effects[k]
    candidate = dataclasses.replace(found, twins=own.twins)
    point = effects[k].fit.point
    fit = fit_candidate(base, base.run.gap, candidate, point if len(point) else None)
    return dataclasses.replace(effects[k], fit=fit)
