"""The process fitted again, behind given effects: for models that were fitted to the records."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.likelihood.noise import MAX_ORDER
from stiction_ros.discrepancy.process.free_equation import (
    Equation,
    Fitted,
    Problem,
    best_fit,
    filtered_fits,
)
from stiction_ros.discrepancy.simulation.free_run import FreeRun, Runs
from stiction_ros.effects import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.processes import AlteredProcess, ArxProcess, Process

LATER = 1  # samples beyond the model's own delays that are tried
REFIT_ROUNDS = 8


def longest_delay(model: LoopModel) -> int:
    """Return the longest delay that is tried behind a candidate, samples.

    Raises:
        InputError: a process that is no ARX process.
    """
    return max(d for equation in equations_of(model) for d in equation.delay) + LATER


def equations_of(model: LoopModel) -> list[Equation]:
    """Return the equation of every output, a valve that does not act on it without b.

    Raises:
        InputError: a process that is no ARX process.
    """
    if not isinstance(model.process, ArxProcess):
        raise InputError("the process is no arx process", where=model.name)
    return [
        Equation(
            np.array(own.a),
            tuple(np.array(own.b.get(v, ())) for v in model.valve_names),
            tuple(own.delay.get(v, 0) for v in model.valve_names),
        )
        for own in model.process.equations
    ]


def with_equations(model: LoopModel, equations: Sequence[Equation]) -> LoopModel:
    """Return the model with other coefficients and delays."""
    document = model.to_mapping()
    for entry, own in zip(document["process"]["outputs"], equations, strict=True):
        each = list(zip(model.valve_names, own.b, own.delay, strict=True))
        entry["a"] = own.a.tolist()
        entry["b"] = {v: b.tolist() for v, b, _ in each if len(b)}
        entry["delay"] = {v: d for v, b, d in each if len(b)}
    return LoopModel.from_mapping(document, model.name)


def process_with(process: Process, equations: Sequence[Equation], sample_time: float) -> Process:
    """Return an ARX process with other coefficients and delays, behind its effects if any.

    Raises:
        InputError: another kind of process.
    """
    if isinstance(process, AlteredProcess):
        inner = process_with(process.inner, equations, sample_time)
        return AlteredProcess(inner, process.effects, sample_time)
    if not isinstance(process, ArxProcess):
        raise InputError("the process is no arx process")
    outputs = []
    for known, own in zip(process.equations, equations, strict=True):
        acting = [j for j, b in enumerate(own.b) if len(b)]
        b = {process.valves[j]: tuple(own.b[j].tolist()) for j in acting}
        delay = {process.valves[j]: own.delay[j] for j in acting}
        outputs.append(dataclasses.replace(known, a=tuple(own.a.tolist()), b=b, delay=delay))
    return ArxProcess(tuple(outputs), process.valves, process.model.stem0, process.model.pv0)


def with_common_rows(runs: Runs, model: LoopModel) -> Runs:
    """Return the records without the first rows that not every delay and order can score.

    Criteria of models with different delays are comparable over the same rows only.
    """
    equations = equations_of(model)
    reach = longest_delay(model) + 2 + max(len(b) for e in equations for b in e.b)
    usable = runs.usable.copy()
    for rows in runs.slices:
        usable[:, rows.start : min(rows.start + reach + MAX_ORDER, rows.stop)] = False
    return dataclasses.replace(runs, usable=usable)


def problems_of(run: FreeRun, stems: FloatArray | None = None) -> list[Problem]:
    """Return the fitting problem of every output; ``stems``, shape (N, m), replace the run's."""
    moved = run.stems if stems is None else stems
    return [
        Problem(run.runs.pv[:, i] - run.known[:, i], moved, run.runs, run.blocks(i))
        for i in range(len(run.model.outputs))
    ]


def refit_output(
    problem: Problem, own: Equation, longest: int, rounds: int = REFIT_ROUNDS
) -> Fitted:
    """Return an output's best equation of the same orders over all delays up to ``longest``.

    Starts are the model's own coefficients and, per delay, those of an equation-error fit that
    is filtered by its own denominator until it settles.
    """
    starts = [own, *_nested(problem, own, longest, rounds)]
    shift = longest - max(own.delay)
    for late in range(-max(own.delay), shift + 1):
        delays = tuple(max(d + late, 0) for d in own.delay)
        each = filtered_fits(problem, own.at(delays))
        starts += [*each[:1], *each[1:][-1:]]
    return best_fit(problem, starts, rounds) or problem.fit(own)


def _nested(problem: Problem, own: Equation, longest: int, rounds: int) -> list[Equation]:
    """Return the best equation with one b less per valve, its last b 0; nothing to take: none.

    So an equation with more coefficients is never fitted worse than one with fewer.
    """
    if max(len(b) for b in own.b) < 2:
        return []
    fewer = dataclasses.replace(own, b=tuple(b[:-1] if len(b) > 1 else b for b in own.b))
    found = refit_output(problem, fewer, longest, rounds).equation
    padded = [
        np.concatenate([b, np.zeros(len(o) - len(b))]) for b, o in zip(found.b, own.b, strict=True)
    ]
    return [dataclasses.replace(found, b=tuple(padded))]


def process_refitted(model: LoopModel, runs: Runs) -> LoopModel:
    """Return the model with ARX coefficients that fit the free run best, by Gauss-Newton.

    Effects and orders stay. The likelihood is that of the innovations on the fitted rows, as
    for every candidate.

    Args:
        model: with an ARX process.
        runs: the records.

    Raises:
        InputError: a process that is no ARX process.
    """
    return refitted(FreeRun(model, with_common_rows(runs, model)), longest_delay(model))


def refitted_behind(bare: LoopModel, run: FreeRun) -> LoopModel:
    """Return ``bare`` with its process fitted again behind the stems of a run with effects."""
    return with_equations(bare, equations_of(refitted(run, longest_delay(bare))))


def open_figures(run: FreeRun) -> list[FloatArray]:
    """Return per output what a unit of each coefficient moves, shape (N, n_a + n_b)."""
    pairs = zip(problems_of(run), equations_of(run.model), strict=True)
    return [problem.sensitivities(own, problem.forced(own)) for problem, own in pairs]


def refitted(run: FreeRun, longest: int, rounds: int = REFIT_ROUNDS) -> LoopModel:
    """Return the model of a free run, its process fitted again behind the run's own stems."""
    found = [
        refit_output(problem, own, longest, rounds).equation
        for problem, own in zip(problems_of(run), equations_of(run.model), strict=True)
    ]
    return with_equations(run.model, found)
