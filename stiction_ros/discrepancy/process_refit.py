"""The process fitted again, behind given effects: for models that were fitted to the records."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.signal import lfilter

from stiction_ros.discrepancy.free_run import FreeRun, Runs
from stiction_ros.discrepancy.noise import Blocks, NoiseFit, fit_noise, whiten
from stiction_ros.effects import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.processes import ArxProcess

RADIUS = 0.9995
PREFILTERINGS = 3
LATER = 1  # samples beyond the model's own delays that are tried


@dataclasses.dataclass(frozen=True)
class _Equation:
    """Coefficients of one output: a (n_a,), and per valve b and delay."""

    a: FloatArray
    b: tuple[FloatArray, ...]
    delay: tuple[int, ...]

    @property
    def denominator(self) -> FloatArray:
        return np.concatenate([[1.0], self.a])

    @property
    def stable(self) -> bool:
        return bool(np.abs(np.roots(self.denominator)).max(initial=0.0) < RADIUS)

    def moved(self, step: FloatArray) -> _Equation:
        """Return the equation with a step in (a, b of each valve) added."""
        first, parts = len(self.a), []
        for b in self.b:
            parts.append(b + step[first : first + len(b)])
            first += len(b)
        return dataclasses.replace(self, a=self.a + step[: len(self.a)], b=tuple(parts))


@dataclasses.dataclass(frozen=True)
class _Problem:
    """One output and the stems that drive it."""

    y: FloatArray
    stems: FloatArray
    runs: Runs
    blocks: Blocks

    def each(
        self, values: FloatArray, numerator: FloatArray, denominator: FloatArray
    ) -> FloatArray:
        """Return a filter's output, started anew in every record."""
        parts = [lfilter(numerator, denominator, values[rows], axis=0) for rows in self.runs.slices]
        return np.concatenate(parts)

    def inputs(self, equation: _Equation) -> list[FloatArray]:
        """Return per valve the delayed stems, in deviations from the first, one column per b."""
        found = []
        for j, b in enumerate(equation.b):
            columns = np.zeros((len(self.y), len(b)))
            for rows in self.runs.slices:
                stem = self.stems[rows, j] - self.stems[rows.start, j]
                for k in range(len(b)):
                    late = 1 + equation.delay[j] + k
                    columns[rows.start + late : rows.stop, k] = stem[: len(stem) - late]
            found.append(columns)
        return found

    def free(self, equation: _Equation) -> FloatArray:
        """Return the responses to the past and to a constant of every record."""
        columns = []
        for rows in self.runs.slices:
            for k in range(len(equation.a)):
                impulse = np.zeros(len(self.y))
                impulse[rows.start + k] = 1.0
                columns.append(impulse)
            one = np.zeros(len(self.y))
            one[rows] = 1.0
            columns.append(one)
        return self.each(np.column_stack(columns), np.ones(1), equation.denominator)

    def forced(self, equation: _Equation) -> FloatArray:
        total = sum(c @ b for c, b in zip(self.inputs(equation), equation.b, strict=True))
        return self.each(np.asarray(total), np.ones(1), equation.denominator)

    def fit(self, equation: _Equation, like: FloatArray | None) -> NoiseFit:
        return fit_noise(self.y - self.forced(equation), self.free(equation), self.blocks, like)

    def sensitivities(self, equation: _Equation, output: FloatArray) -> FloatArray:
        """Return the derivatives of the free run with respect to (a, b), shape (N, n_a + Σ n_b)."""
        columns = []
        for k in range(1, len(equation.a) + 1):
            late = np.zeros_like(output)
            for rows in self.runs.slices:
                late[rows.start + k : rows.stop] = -output[rows.start : rows.stop - k]
            columns.append(late[:, None])
        columns += self.inputs(equation)
        return self.each(np.hstack(columns), np.ones(1), equation.denominator)


def refit_process(model: LoopModel, runs: Runs, rounds: int = 8) -> LoopModel:
    """Return the model with ARX coefficients that fit the free run best, by Gauss-Newton.

    Effects, orders and delays stay. The likelihood is that of the innovations on the fitted
    rows, as for every candidate. Starts are the model's own coefficients and those of an
    equation-error fit that is filtered by its own denominator until it settles.

    Raises:
        InputError: a process that is no ARX process.
    """
    if not isinstance(model.process, ArxProcess):
        raise InputError("the process is no arx process", where=model.name)
    run = FreeRun(model, runs)
    document = model.to_mapping()
    for i, own in enumerate(model.process.equations):
        problem = _Problem(runs.pv[:, i] - run.known[:, i], run.stems, runs, run.blocks(i))
        valves = model.valve_names
        equation = _Equation(
            np.array(own.a),
            tuple(np.array(own.b.get(v, ())) for v in valves),
            tuple(own.delay.get(v, 0) for v in valves),
        )
        best = _best_fit(problem, equation, rounds)
        entry = document["process"]["outputs"][i]
        entry["a"] = best.a.tolist()
        entry["b"] = {v: b.tolist() for v, b in zip(valves, best.b, strict=True) if len(b)}
        entry["delay"] = {
            v: d for v, b, d in zip(valves, best.b, best.delay, strict=True) if len(b)
        }
    return LoopModel.from_mapping(document, model.name)


def _best_fit(problem: _Problem, own: _Equation, rounds: int) -> _Equation:
    starts = [own]
    longest = max(own.delay) + LATER
    for delay in range(longest + 1):
        shifted = tuple(max(d - longest + LATER + delay, 0) for d in own.delay)
        starts += _filtered_fits(problem, dataclasses.replace(own, delay=shifted))[-1:]
    fitted = [(problem.fit(start, None), start) for start in starts if start.stable]
    fit, equation = min(fitted, key=lambda each: each[0].bic(0))
    for _ in range(rounds):
        total = problem.y - fit.residual
        columns = np.hstack([problem.sensitivities(equation, total), problem.free(equation)])
        rows = problem.blocks.train
        inner = whiten(columns, fit.ar)[rows]
        scale = np.maximum(np.linalg.norm(inner, axis=0), 1e-300)
        target = whiten(fit.residual, fit.ar)[rows]
        step = np.linalg.lstsq(inner / scale, target, rcond=1e-9)[0] / scale
        improved = _line_search(problem, equation, fit, step)
        if improved is None:
            break
        gain = fit.bic(0) - improved[0].bic(0)
        fit, equation = improved
        if gain < 0.1:
            break
    return equation


def _line_search(
    problem: _Problem, equation: _Equation, fit: NoiseFit, step: FloatArray
) -> tuple[NoiseFit, _Equation] | None:
    for share in (1.0, 0.4, 0.1):
        tried = equation.moved(share * step)
        if not tried.stable:
            continue
        found = problem.fit(tried, fit.ar)
        if found.bic(0) < fit.bic(0):
            return found, tried
    return None


def _filtered_fits(problem: _Problem, own: _Equation) -> list[_Equation]:
    """Return equation-error fits, the data filtered by 1/A of the fit before."""
    found, equation = [], own
    denominator = np.ones(1)
    for _ in range(PREFILTERINGS):
        y = problem.each(problem.y, np.ones(1), denominator)
        columns = []
        for k in range(1, len(own.a) + 1):
            late = np.zeros_like(y)
            late[k:] = -y[:-k]
            columns.append(late[:, None])
        columns += [problem.each(c, np.ones(1), denominator) for c in problem.inputs(own)]
        count = sum(c.shape[1] for c in columns)
        ones = np.column_stack([_inside(len(y), rows) for rows in problem.runs.slices])
        columns.append(problem.each(ones, np.ones(1), denominator))
        whole = np.hstack(columns)[problem.blocks.train]
        scale = np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
        theta = np.linalg.lstsq(whole / scale, y[problem.blocks.train], rcond=1e-10)[0] / scale
        zero = dataclasses.replace(
            own, a=np.zeros_like(own.a), b=tuple(np.zeros_like(b) for b in own.b)
        )
        equation = zero.moved(theta[:count])
        if not equation.stable:
            break
        found.append(equation)
        denominator = equation.denominator
    return found


def _inside(count: int, rows: slice) -> FloatArray:
    column = np.zeros(count)
    column[rows] = 1.0
    return column
