"""A given process a few per cent off: what of it has to be changed beside the effects."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.decision.explanation import (
    AddedEffect,
    Explanation,
    ProcessChange,
    open_columns,
    refit_together,
    run_with,
)
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.least_squares import left_by
from stiction_ros.discrepancy.likelihood.noise import NoiseFit
from stiction_ros.discrepancy.measures import (
    MAJORITY,
    MARGIN,
    NEARLY_ALL,
    NEGLIGIBLE,
    NORMAL,
    PROBE,
    ROUNDING,
    SLIGHT,
    STEPS,
)
from stiction_ros.discrepancy.simulation.equation import GAIN, Changeable, with_equation
from stiction_ros.discrepancy.simulation.free_run import FreeRun, Runs
from stiction_ros.effects import FloatArray
from stiction_ros.effects.behaviour import BoolArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.processes import ArxProcess
from stiction_ros.signals.autoregression import whiten

SURE = 2.5  # standard errors by which a figure has to be another than the model's
LARGEST_STEP = 0.5  # of an effect's figure
Tried = tuple[float, BoolArray, FloatArray, FloatArray, tuple[AddedEffect, ...]]


def changed_process(
    bare: LoopModel, runs: Runs, effects: Sequence[AddedEffect], declared: bool = True
) -> Explanation | None:
    """Return effects behind a process with gain, time constants and dead time at their best.

    The gain of an output, each of its time constants and its dead time are stepped by
    Gauss-Newton on the likelihood, together with what stands in for them: the figures of effects
    that are smooth, as the curve of a valve, and linear ones. One figure after the other that is
    not surely another than the model's goes back to it. The effects are fitted again at last.

    Args:
        bare: the model without effects.
        runs: the records.
        effects: that stand beside it, with their figures.
        declared: whether the noise is the declared one, where there is one, or the larger one
            that explains most as long as nothing is changed.

    Returns:
        None where nothing is surely another, or the process is no ARX process.
    """
    if not isinstance(bare.process, ArxProcess):
        return None
    model, changes, beside = bare, [], tuple(effects)
    slopes: list[FloatArray] = []
    for output, name in enumerate(bare.outputs):
        search = _Search(model, runs, beside, output, declared)
        if not search.run():
            slopes.append(np.zeros((len(runs), 0)))
            continue
        model, beside = search.changed(search.values), search.effects
        changes += search.changes(name)
        slopes.append(search.slopes())
    if not changes:
        return None
    fitted = refit_together(model, runs, beside) if beside else ()
    return Explanation.of(model, runs, fitted, tuple(changes), tuple(slopes))


def refitted_process(bare: LoopModel, runs: Runs, effects: Sequence[AddedEffect] = ()) -> LoopModel:
    """Return the model with all figures of its process at their best: it was fitted to records.

    Args:
        bare: the model without effects, with an ARX process.
        runs: the records.
        effects: behind which its process is fitted again, with their figures.
    """
    model = bare
    for output in range(len(bare.outputs)):
        model = _Search(model, runs, tuple(effects), output, declared=False).refitted()
    return model


def open_figures(run: FreeRun) -> list[FloatArray]:
    """Return per output what a unit of each figure of its process moves, shape (N, figures)."""
    searches = [_Search(run.model, run.runs, (), i, False) for i in range(len(run.model.outputs))]
    return [search.moved_by(run, run.gap[:, search.output]) for search in searches]


def _stepped(effect: AddedEffect, more: float) -> AddedEffect:
    """Return an effect with ``more`` of its first figure, in coordinates of its search."""
    candidate, point = effect.fit.candidate, effect.fit.point.copy()
    axis = candidate.axes[0]
    moved = axis.outer(np.array([axis.inner(float(point[0])) + more]))
    point[0] = np.clip(moved[0], axis.low, axis.high)
    return dataclasses.replace(effect, fit=dataclasses.replace(effect.fit, point=point))


class _Search:
    """The figures of one output, stepped from the model's own."""

    def __init__(
        self,
        model: LoopModel,
        runs: Runs,
        effects: tuple[AddedEffect, ...],
        output: int,
        declared: bool,
    ) -> None:
        self.model, self.runs, self.effects, self.output = model, runs, effects, output
        self.declared = declared
        self.smooth = [k for k, each in enumerate(effects) if each.fit.candidate.smooth]
        if not isinstance(model.process, ArxProcess):
            raise InputError("the process is no arx process", where=model.name)
        self.equation = Changeable(model.process.equations[output])
        self.figures = self.equation.figures
        self.least = np.array([each.least for each in self.figures])
        self.most = np.array([each.most for each in self.figures])
        self.gains = np.array([each.what == GAIN for each in self.figures])
        self.free = np.ones(len(self.figures), dtype=bool)
        self.values, self.errors = np.zeros(len(self.free)), np.full(len(self.free), np.inf)

    def refitted(self) -> LoopModel:
        """Return the model with all figures stepped; as it was where that explains no more."""
        before = self._state()[0]
        self._settle()
        return self.changed(self.values) if self._state()[0] < before else self.model

    def run(self) -> bool:
        """Step all figures, then each alone, as they may trade off; several gain the margin."""
        found: list[Tried] = []
        effects, count = self.effects, len(self.figures)
        for free in (np.ones(count, dtype=bool), *np.eye(count, dtype=bool)):
            if found and np.array_equal(free, found[0][1]):
                continue  # all but this one were let go
            self.free, self.effects = free, effects
            self.values, self.errors = np.zeros(count), np.full(count, np.inf)
            if self._eliminate():
                found.append(self._state())
        if found:
            _, self.free, self.values, self.errors, self.effects = min(found, key=lambda e: e[0])
        return bool(found)

    def _state(self) -> Tried:
        """Return the figures as they are, after the BIC that they leave, several by the margin."""
        run = self._run(self.values)
        base = Baseline.of(run, columns=open_columns(run, self.effects))
        count = int(self.free.sum())
        score = self._noise(base).bic(count) + (MARGIN if count > 1 else 0.0)
        return score, self.free.copy(), self.values.copy(), self.errors.copy(), self.effects

    def _eliminate(self) -> bool:
        """Step all figures, then let the least sure one go, until the rest is sure."""
        while self.free.any():
            self._settle()
            sure = np.where(self.free, np.abs(self.values) / self.errors, np.inf)
            bound = self.values >= NEARLY_ALL * self.most
            bound |= (self.values <= NEARLY_ALL * self.least) & self.gains
            bound &= self.free
            kinds = [
                f.what if free else "" for f, free in zip(self.figures, self.free, strict=True)
            ]
            sure[bound & [kinds.count(kind) > 1 for kind in kinds]] = 0.0  # alike, they trade off
            least = int(np.argmin(sure))
            if sure[least] > SURE:
                return not bound.any()
            self.free[least], self.values[least], self.errors[least] = False, 0.0, np.inf
        return False

    def _settle(self) -> None:
        """Step all free figures, and those of smooth effects, until they settle."""
        free, least = self.free, np.inf
        count = int(free.sum())
        best, step = (self.values, self.effects), np.zeros(count + len(self.smooth))
        for _ in range(STEPS):
            run = self._run(self.values)
            base = Baseline.of(run, columns=open_columns(run, self.effects))
            noise = self._noise(base)
            if noise.bic(0) > least:  # the last step was too long
                step = 0.5 * step
            else:
                least, best = noise.bic(0), (self.values, self.effects)
                step = self._bounded(self._step(run, base, noise.ar))
            self.values, self.effects = best
            moved = np.zeros(len(free))
            moved[free] = step[:count]
            self.values = np.clip(self.values + moved, self.least, self.most)
            for k, each in zip(self.smooth, step[count:].tolist(), strict=True):
                self.effects = self._with_stepped(k, each)
            if np.all(np.abs(step) < NEGLIGIBLE * PROBE):
                break

    def _noise(self, base: Baseline) -> NoiseFit:
        """Return the declared noise, where it is to be kept, or the one that explains most."""
        given = self.declared and base.declared[self.output]
        return base.under_declared(self.output) if given else base.noise[self.output]

    def _step(self, run: FreeRun, base: Baseline, ar: FloatArray) -> FloatArray:
        """Return Gauss-Newton's step of all that is free, and set the standard errors."""
        train, gap = base.blocks[self.output].train, run.gap[:, self.output]
        basis = base.basis(self.output, ar)
        target = left_by(basis, whiten(gap, ar)[train])
        white = left_by(basis, whiten(self._slopes(run, gap), ar)[train])
        step, *_ = np.linalg.lstsq(white, -target, rcond=1e-8)
        left = target + white @ step
        told = base.blocks[self.output].measured * (len(left) - len(step))
        variance = float(left @ left) / max(told, 1.0)
        spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(white.T @ white)) * variance, 0.0))
        seen = np.linalg.norm(white, axis=0) > ROUNDING * np.linalg.norm(target)
        seen &= spread > 0.0
        self.errors[self.free] = np.where(seen, spread, np.inf)[: int(self.free.sum())]
        return np.asarray(step)

    def _bounded(self, step: FloatArray) -> FloatArray:
        """Return a step of which no figure goes more than half the way to its bound."""
        free, count = self.free, int(self.free.sum())
        room = 0.5 * np.where(step[:count] < 0.0, -self.least[free], self.most[free])
        own = np.where(room > 0.0, step[:count], 0.0)
        own /= max(float(np.max(np.abs(own) / np.maximum(room, ROUNDING))), 1.0)
        return np.concatenate([own, np.clip(step[count:], -LARGEST_STEP, LARGEST_STEP)])

    def slopes(self) -> FloatArray:
        """Return what a unit of every free figure moves, shape (N, figures)."""
        run = self._run(self.values)
        return self.moved_by(run, run.gap[:, self.output])

    def moved_by(self, run: FreeRun, gap: FloatArray) -> FloatArray:
        """Return what a unit of every free figure moves of a run with this gap, (N, figures)."""
        moved = []
        for k, each in enumerate(np.eye(len(self.free))):
            if self.free[k]:
                equation = self.equation.changed(self.values + PROBE * each)
                other = with_equation(
                    run.model.process, self.output, equation, run.runs.sample_time
                )
                moved.append((run.gap_behind(other, self.output) - gap) / PROBE)
        return np.column_stack(moved)

    def _slopes(self, run: FreeRun, gap: FloatArray) -> FloatArray:
        """Return what a unit of every free figure and smooth effect moves, shape (N, figures)."""
        moved = [self.moved_by(run, gap)]
        model = run.model if not self.smooth else self.changed(self.values)
        for k in self.smooth:
            other = run_with(model, self.runs, self._with_stepped(k, PROBE))
            moved.append((other.gap[:, self.output] - gap) / PROBE)
        return np.column_stack(moved)

    def _with_stepped(self, k: int, more: float) -> tuple[AddedEffect, ...]:
        other = _stepped(self.effects[k], more)
        return (*self.effects[:k], other, *self.effects[k + 1 :])

    def _run(self, values: FloatArray) -> FreeRun:
        return run_with(self.changed(values), self.runs, self.effects)

    def changed(self, values: FloatArray) -> LoopModel:
        """Return the model with other figures of this output, shape (figures,)."""
        document, told = self.model.to_mapping(), self.equation.changed(values).to_mapping()
        entry = document["process"]["outputs"][self.output]
        entry.update({key: told[key] for key in ("a", "b", "delay")})
        return LoopModel.from_mapping(document, self.model.name)

    def changes(self, name: str) -> list[ProcessChange]:
        """Return the figures that are another, by the tag of the output."""
        step, found = self.runs.sample_time, []
        for k in np.flatnonzero(self.free).tolist():
            own = self.figures[k]
            ends = self.values[k] + np.array([0.0, -NORMAL, NORMAL]) * self.errors[k]
            late = own.what == "delay"
            value, low, high = (step * ends if late else np.maximum(1.0 + ends, 0.0)).tolist()
            model = None if own.lasts is None else own.lasts * step
            size = abs(float(self.values[k]))
            lasts = np.inf if own.lasts is None else own.lasts  # samples; a gain has none
            matters = size >= MAJORITY if late else size >= max(SLIGHT, MAJORITY / lasts)
            unit = "s" if late else "1"
            found.append(ProcessChange(name, own.what, value, (low, high), unit, model, matters))
        return found
