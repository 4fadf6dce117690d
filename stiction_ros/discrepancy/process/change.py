"""A given process a few per cent off: what of it has to be changed beside the effects."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from stiction_ros.discrepancy.decision.extend import AddedEffect, run_with
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.noise import left_by, projector, whiten, whitened_columns
from stiction_ros.discrepancy.process.free_equation import Equation
from stiction_ros.discrepancy.process.refit import equations_of, with_equations
from stiction_ros.discrepancy.simulation.free_run import Runs
from stiction_ros.effects import FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.processes import ArxProcess

WHAT = ("gain", "time_constants", "delay")
PROBES = np.array([0.01, 0.01, 0.1])  # of the derivatives: two logarithms, samples
MOST = np.array([0.15, 0.2, 1.5])  # beyond that it is an effect, not an error of the model
OF_DELAY = 0.15  # of the model's dead time, where that is more
STEPS = 5
TINY_STEP = 0.02  # of the probes, at which it has settled
SURE = 2.5  # standard errors by which a figure has to be another than the model's
NORMAL = 1.96


@dataclasses.dataclass(frozen=True)
class ProcessChange:
    """One figure of the process that is another than the model says.

    Attributes:
        output: tag.
        what: ``gain``, ``time_constants`` or ``delay``.
        value: factor of the gain or of all time constants; seconds of dead time beyond the
            model's, negative for less.
        interval: 95 %.
        unit: of the value.
    """

    output: str
    what: str
    value: float
    interval: tuple[float, float]
    unit: str

    def to_json(self) -> dict[str, Any]:
        """Return the entry of ``process_changes`` in ``gap --json``."""
        return dataclasses.asdict(self) | {"interval": list(self.interval)}


@dataclasses.dataclass(frozen=True)
class ChangedProcess:
    """A model whose process follows the records better.

    Attributes:
        model: without effects.
        changes: figures that were changed.
    """

    model: LoopModel
    changes: tuple[ProcessChange, ...]


def changed_process(
    bare: LoopModel, runs: Runs, effects: Sequence[AddedEffect]
) -> ChangedProcess | None:
    """Return the model with gain, time constants and dead time at their best behind effects.

    One factor for the gain of an output, one for all its time constants and one more dead time
    are stepped by Gauss-Newton on the likelihood; figures that are not surely another than the
    model's stay.

    Args:
        bare: the model without effects.
        runs: the records.
        effects: that stand beside it, with their figures.

    Returns:
        None where nothing is surely another, or the process is no ARX process.
    """
    if not isinstance(bare.process, ArxProcess):
        return None
    model, changes = bare, []
    for output, name in enumerate(bare.outputs):
        figures, errors = _settled(model, runs, effects, output)
        sure = np.abs(figures) > SURE * errors
        while sure.any() and not sure.all():
            again, errors = _settled(model, runs, effects, output, sure)
            still = sure & (np.abs(again) > SURE * errors)
            figures = again
            if (still == sure).all():
                break
            sure = still
        if not sure.any() or np.any(np.abs(figures) >= 0.99 * _most(model, output)):
            continue
        model = _changed(model, output, np.where(sure, figures, 0.0))
        step = runs.sample_time
        for k in np.flatnonzero(sure).tolist():
            ends = figures[k] + np.array([0.0, -NORMAL, NORMAL]) * errors[k]
            value, low, high = (step * ends if WHAT[k] == "delay" else np.exp(ends)).tolist()
            unit = "s" if WHAT[k] == "delay" else "1"
            changes.append(ProcessChange(name, WHAT[k], value, (low, high), unit))
    return ChangedProcess(model, tuple(changes)) if changes else None


def _settled(
    model: LoopModel,
    runs: Runs,
    effects: Sequence[AddedEffect],
    output: int,
    free: np.ndarray[Any, np.dtype[np.bool_]] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return log gain, log time constants and delay, samples, with their standard errors."""
    free = np.ones(3, dtype=bool) if free is None else free
    figures, errors = np.zeros(3), np.full(3, np.inf)
    for _ in range(STEPS):
        base = Baseline.of(run_with(_changed(model, output, figures), runs, effects))
        noise, train = base.noise[output], base.blocks[output].train
        ar = base.declared[output][0] if base.declared[output] else noise.ar
        gap = base.run.gap[:, output]
        slopes = np.column_stack(
            [
                (_gap(model, runs, effects, output, figures + PROBES * each) - gap) / PROBES[k]
                for k, each in enumerate(np.eye(3))
                if free[k]
            ]
        )
        basis = projector(whitened_columns(base.columns[output], ar, train))
        target = left_by(basis, whiten(gap, ar)[train])
        white = left_by(basis, whiten(slopes, ar)[train])
        step, *_ = np.linalg.lstsq(white, -target, rcond=1e-8)
        left = target + white @ step
        variance = float(left @ left) / max(len(left) - 3, 1)
        spread = np.linalg.pinv(white.T @ white) * variance
        errors = np.full(3, np.inf)
        errors[free] = np.sqrt(np.maximum(np.diag(spread), 0.0))
        moved, most = np.zeros(3), _most(model, output)
        moved[free] = np.clip(step, -0.5 * most[free], 0.5 * most[free])
        figures = np.clip(figures + moved, -most, most)
        if np.all(np.abs(moved) < TINY_STEP * PROBES):
            break
    return figures, errors


def _most(model: LoopModel, output: int) -> FloatArray:
    """Return the largest changes that count as errors of a model, shape (3,)."""
    delay = max(equations_of(model)[output].delay)
    return np.array([MOST[0], MOST[1], max(MOST[2], OF_DELAY * delay)])


def _gap(
    model: LoopModel,
    runs: Runs,
    effects: Sequence[AddedEffect],
    output: int,
    figures: FloatArray,
) -> FloatArray:
    return run_with(_changed(model, output, figures), runs, effects).gap[:, output]


def _changed(model: LoopModel, output: int, figures: FloatArray) -> LoopModel:
    """Return the model with one output's gain, time constants and dead time changed."""
    equations = equations_of(model)
    own = equations[output]
    stretch = math.exp(float(figures[1]))
    poles = np.roots(np.concatenate([[1.0], own.a]))
    slower = np.array([_slower(pole, stretch) for pole in poles])
    a = np.real(np.poly(slower))[1:] if len(poles) else own.a
    moved = np.abs(slower - poles) > 0.0
    level = float(np.real(np.prod((1.0 - slower[moved]) / (1.0 - poles[moved]))))
    gain = math.exp(float(figures[0])) * level
    later = float(figures[2])
    b, delays = [], []
    for each, delay in zip(own.b, own.delay, strict=True):
        if not len(each):
            b.append(each)
            delays.append(delay)
            continue
        whole = math.floor(max(delay + later, 0.0))
        share = max(delay + later, 0.0) - whole
        b.append(gain * np.convolve(each, [1.0 - share, share]))
        delays.append(whole)
    changed = Equation(np.asarray(a), tuple(b), tuple(delays))
    return with_equations(model, [*equations[:output], changed, *equations[output + 1 :]])


def _slower(pole: complex, stretch: float) -> complex:
    """Return the pole of a time constant that is longer by a factor; those at 0 and 1 stay."""
    if abs(pole) < 1e-9 or abs(pole - 1.0) < 1e-9 or (pole.imag == 0.0 and pole.real < 0.0):
        return complex(pole)
    return complex(np.exp(np.log(complex(pole)) / stretch))
