"""Identification by evidence: friction first, under any smooth process, then the process."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable

import numpy as np

from stiction_ros.identification.conclusion import Findings, conclude
from stiction_ros.identification.engine import order_row
from stiction_ros.identification.evidence.accepted import Accepted, accepted
from stiction_ros.identification.evidence.kernels import whitened
from stiction_ros.identification.evidence.problem import Problem
from stiction_ros.identification.evidence.search import Candidate, Found, search
from stiction_ros.identification.models import Data, Model, linear_model, settle_delays, stem_of
from stiction_ros.identification.options import IdentificationOptions
from stiction_ros.identification.preparation import (
    input_order_for,
    prepare,
    tried_orders,
    window,
)
from stiction_ros.identification.results import Identification, ValveEstimate, VerdictKind
from stiction_ros.records.record import Record

Progress = Callable[[float], None]


def identify(
    record: Record,
    options: IdentificationOptions | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify friction by its evidence, and linear dynamics for the stems that it gives.

    Args:
        record: what was measured.
        options: None for the defaults; of ``delay`` the lower end alone plays a part in the
            search for friction, which needs no order either.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: a record that no model can be fitted to, or an unknown law.
    """
    begun = time.perf_counter()
    options = options or IdentificationOptions()
    report = progress or (lambda share: None)
    data = prepare(record, options)
    report(0.02)
    problem = Problem.of(record, options.law, skipped=options.delay[0])
    found = search(problem)
    report(0.7)
    valves = tuple(_judged(record, problem, found, j, options) for j in range(len(record.valves)))
    model, table = _process(data, options, valves, found)
    report(1.0)
    findings = Findings(model, valves, table, (), None)
    return conclude(record, data, findings, time.perf_counter() - begun)


def _judged(
    record: Record, problem: Problem, found: Found, valve: int, options: IdentificationOptions
) -> ValveEstimate:
    held = accepted(problem, found, valve, options.confidence)
    figures = evidence_of(problem, found, valve)
    figures["deadband_loss"] = held.deadband_loss
    static, dynamic = (float(value) for value in found.best.friction[valve])
    verdict = _verdict(figures, held, float(problem.limit[valve]), options)
    believed = verdict is VerdictKind.STICKY
    low = (held.static[0], held.dynamic[0]) if believed else (0.0, 0.0)
    if verdict is VerdictKind.HEALTHY:
        static = dynamic = 0.0
    stem = stem_of_valve(problem, valve, (static, dynamic))
    return ValveEstimate(
        name=record.valves[valve],
        verdict=verdict,
        law=options.law,
        static_friction=static,
        static_interval=(low[0], max(held.static[1], static)),
        dynamic_friction=dynamic,
        dynamic_interval=(low[1], max(held.dynamic[1], dynamic)),
        jump=0.0 if held.deadband_loss < 4.0 else static - dynamic,
        stem_start=float(record.op[0, valve]),
        moves=int(np.count_nonzero(np.diff(stem))),
        evidence=figures,
        profile=held.profile,
    )


def stem_of_valve(problem: Problem, valve: int, friction: tuple[float, float]) -> np.ndarray:
    """Return the scaled stem of a valve, shape (n,)."""
    return np.asarray(problem.stems(valve, np.array([friction]), 0.0)[0])


def evidence_of(problem: Problem, found: Found, valve: int) -> dict[str, float]:
    """Return the named figures behind the verdict on one valve."""
    best, without = found.best, found.ideal
    count = problem.count * len(problem.pv)
    gain = without.loss - best.loss
    halves = _half_gains(problem, best, without)
    stem = best.stems[valve]
    return {
        "delta_bic": gain - 2.0 * float(np.log(count)),
        "free_run_ratio": _free_run(problem, without) / _free_run(problem, best),
        "half_1": halves[0],
        "half_2": halves[1],
        "share": float(best.friction[valve, 0] / problem.limit[valve]),
        "moves": float(np.count_nonzero(np.diff(stem))),
    }


def _half_gains(problem: Problem, best: Candidate, without: Candidate) -> tuple[float, float]:
    """Return −2 log likelihood gained by friction in both halves, variances from the whole."""
    gain = np.zeros(problem.count)
    for one, other in zip(best.fits, without.fits, strict=True):
        for fit, sign in ((other, 1.0), (one, -1.0)):
            seen = whitened(fit.noise, fit.rest, float(fit.rest[0]))[problem.first :]
            variance = float(np.mean(seen**2))
            gain += sign * (seen**2 / variance + np.log(variance))
    middle = len(gain) // 2
    return float(gain[:middle].sum()), float(gain[middle:].sum())


def _free_run(problem: Problem, candidate: Candidate) -> float:
    return float(sum(np.sum(fit.rest[problem.first :] ** 2) for fit in candidate.fits))


def _verdict(
    figures: dict[str, float], held: Accepted, span: float, options: IdentificationOptions
) -> VerdictKind:
    negligible = options.negligible_share * span
    if figures["delta_bic"] > options.bic_margin and held.band[0] > negligible:
        if min(figures["half_1"], figures["half_2"]) > 0.0:
            return VerdictKind.STICKY
        return VerdictKind.UNDECIDED
    if held.band[1] <= 2.0 * negligible and figures["moves"] >= options.min_moves:
        return VerdictKind.HEALTHY
    return VerdictKind.UNDECIDED


def _process(
    data: Data,
    options: IdentificationOptions,
    valves: tuple[ValveEstimate, ...],
    found: Found,
) -> tuple[Model, tuple]:
    """Return orders, delays and linear parts for the stems, and all orders that were tried."""
    friction = np.array([[v.static_friction, v.dynamic_friction] for v in valves])
    stems = data.u.copy()
    for j in np.flatnonzero(friction[:, 0]):
        stems[j] = stem_of(data, int(j), friction[j], 0.0)
    delays = ((data.delay[0],) * len(valves),) * len(data.y)
    base = Model(friction, np.zeros(len(valves)), stems, delays, ())
    tried = [window(options, n, input_order_for(options, n)) for n in tried_orders(options)]
    models = [linear_model(data, orders, base) for orders in tried]
    table = tuple(order_row(*pair) for pair in zip(tried, models, strict=True))
    best = min(range(len(models)), key=lambda i: models[i].bic)
    model, _ = settle_delays(data, models[best], tried[best])
    return dataclasses.replace(model, friction=friction), table
