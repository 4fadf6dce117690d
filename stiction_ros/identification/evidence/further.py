"""A law's further parameters under the evidence for friction."""

import dataclasses

import numpy as np

from stiction_ros.deferred import chi2_quantile
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.evidence.accepted import FREEDOM, MISFIT
from stiction_ros.identification.evidence.candidate import Candidate, Judge, ideal
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.output_fit import white
from stiction_ros.identification.evidence.search import DRIFT, Found, search
from stiction_ros.identification.friction import FurtherSearch, Settled, first_values, searched
from stiction_ros.identification.result import ValveEstimate

EQUAL = 10.0
"""Loss by which other values than those they begin at must be better before the search."""
FURTHER_LAW_ROUNDS = 2


def settled(problem: Problem) -> tuple[tuple[float, ...], ...]:
    """Return the values at which the law's further parameters are held, per valve."""
    (law,) = set(problem.laws)
    first = first_values(law)
    if not searched(law):
        return (first,) * len(problem.op) if first else ()
    problem = dataclasses.replace(problem, further=(first,) * len(problem.op))
    beside = ideal(problem)
    for valve in range(len(problem.op)):
        for memory in (0.0, DRIFT):
            fits = [white(problem, i, beside.stems, memory) for i in range(len(problem.pv))]
            seen = _search(problem, dataclasses.replace(beside, fits=tuple(fits)), valve)
            found = seen.everywhere()
            known = np.all(found.rows[:, 2:-1] == np.array(first), axis=1)
            if found.loss[0] < found.loss[known].min() - EQUAL:
                problem = _with_further(problem, valve, found.rows[0])
    for _ in range(FURTHER_LAW_ROUNDS):
        before, best = problem, search(problem).best
        for valve in np.flatnonzero(best.friction[:, 0]).tolist():
            problem = _with_further(problem, valve, _nearby(problem, best, valve).rows[0])
        if problem.further == before.further:
            break
    return problem.further


def with_further(
    valve: ValveEstimate, problem: Problem, found: Found, j: int, confidence: float
) -> ValveEstimate:
    """Return the estimate of valve j with its further parameters and intervals over all."""
    best = found.best
    keys = [entry.key for entry in problem.laws[j].parameters()[2:]]
    if not keys or best.friction[j, 0] == 0.0 or valve.static_friction == 0.0:
        return valve
    values = dict(zip(keys, problem.further[j], strict=True))
    if not searched(problem.laws[j]):
        return dataclasses.replace(valve, further=values)
    gain = max(found.without[j].loss - best.loss, 0.0)
    slack = chi2_quantile(confidence, FREEDOM + len(keys)) + MISFIT * gain
    span = float(problem.span[j])
    rows = _nearby(problem, best, j).accepted(slack)
    rows = np.column_stack([span * rows[:, :2], rows[:, 2:-1], span * rows[:, -1]])
    return widened(valve, values, rows)


def widened(valve: ValveEstimate, further: dict[str, float], rows: FloatArray) -> ValveEstimate:
    """Return an estimate with further parameters, its intervals those of all accepted rows.

    Args:
        valve: as found with them held.
        further: their values.
        rows: (f_S, f_D, further …, start) that the record does not reject, shape (G, 3 + n).
    """
    low, high = rows.min(axis=0).tolist(), rows.max(axis=0).tolist()
    ends = {
        key: (min(low[2 + k], value), max(high[2 + k], value))
        for k, (key, value) in enumerate(further.items())
        if high[2 + k] > low[2 + k]
    }
    static, dynamic, band = valve.static_interval, valve.dynamic_interval, valve.band_interval
    if band is not None:
        sums = rows[:, :2].sum(axis=1)
        band = (min(band[0], float(sums.min())), max(band[1], float(sums.max())))
    return dataclasses.replace(
        valve,
        further=further,
        further_intervals=ends,
        static_interval=(min(static[0], low[0]), max(static[1], high[0])),
        dynamic_interval=(min(dynamic[0], low[1]), max(dynamic[1], high[1])),
        band_interval=band,
    )


def _nearby(problem: Problem, best: Candidate, valve: int) -> Settled:
    row = [*best.friction[valve], *problem.further[valve], best.starts[valve]]
    return _search(problem, best, valve).round_about(np.array(row))


def _search(problem: Problem, beside: Candidate, valve: int) -> FurtherSearch:
    judge = Judge.of(problem, beside, valve, beside.fits)
    return FurtherSearch(problem.laws[valve], float(problem.limit[valve]), judge.losses)


def _with_further(problem: Problem, valve: int, row: FloatArray) -> Problem:
    held = list(problem.further)
    held[valve] = tuple(row[2:-1].tolist())
    return dataclasses.replace(problem, further=tuple(held))
