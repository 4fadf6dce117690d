"""Identification by evidence: friction first, under any smooth process, then the process."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.closed_loop.explanation import RIVAL, explained
from stiction_ros.identification.conclusion import Findings, conclude
from stiction_ros.identification.engine import order_row
from stiction_ros.identification.evidence.accepted import Accepted, accepted
from stiction_ros.identification.evidence.kernels import whitened
from stiction_ros.identification.evidence.output_fit import OutputFit
from stiction_ros.identification.evidence.problem import Problem
from stiction_ros.identification.evidence.search import Candidate, Found, search
from stiction_ros.identification.models import Data, Model, linear_model, settle_delays, stem_of
from stiction_ros.identification.options import IdentificationOptions
from stiction_ros.identification.preparation import prepare, windows
from stiction_ros.identification.results import (
    Identification,
    OrderRow,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.identification.verdict import half_gains
from stiction_ros.records.record import Record

Progress = Callable[[float], None]

LEAST_GONE = 0.1  # share of OP's movement that must go away with a friction


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
    model, table = _process(data, options, valves, record)
    report(1.0)
    concluded = conclude(record, data, Findings(model, valves, table, (), None), 0.0)
    looped = explained(record, dataclasses.replace(concluded, method="evidence"))
    judged = tuple(_doubted(valve) for valve in looped.valves)
    return dataclasses.replace(looped, valves=judged, seconds=time.perf_counter() - begun)


def _doubted(valve: ValveEstimate) -> ValveEstimate:
    """Return the estimate, no longer sticky where its loop says otherwise.

    A wave of one period that explains the record nearly as well comes from outside, and a
    friction without which OP would move all the same is not what moves it.
    """
    if valve.verdict is not VerdictKind.STICKY:
        return valve
    wave = valve.evidence.get("line_rivalry", 0.0) > RIVAL
    idle = 0.0 < valve.evidence.get("loop_gone", 1.0) < LEAST_GONE
    if not (wave or idle):
        return valve
    return dataclasses.replace(
        valve,
        verdict=VerdictKind.UNDECIDED,
        static_interval=(0.0, valve.static_interval[1]),
        dynamic_interval=(0.0, valve.dynamic_interval[1]),
    )


def _judged(
    record: Record, problem: Problem, found: Found, valve: int, options: IdentificationOptions
) -> ValveEstimate:
    held = accepted(problem, found, valve, options.confidence)
    figures = evidence_of(problem, found, valve)
    figures["deadband_loss"] = held.deadband_loss
    verdict = _verdict(figures, held, float(problem.limit[valve]), options)
    believed = verdict is VerdictKind.STICKY
    low = (held.static[0], held.dynamic[0]) if believed else (0.0, 0.0)
    chosen = found.ideal if verdict is VerdictKind.HEALTHY else found.best
    static, dynamic = (float(value) for value in chosen.friction[valve])
    return ValveEstimate(
        name=record.valves[valve],
        verdict=verdict,
        law=options.law,
        static_friction=static,
        static_interval=(low[0], max(held.static[1], static)),
        dynamic_friction=dynamic,
        dynamic_interval=(low[1], max(held.dynamic[1], dynamic)),
        jump=0.0 if held.deadband_loss < 4.0 else static - dynamic,
        stem_start=float(record.op[0, valve]) + float(chosen.starts[valve]),
        moves=int(np.count_nonzero(np.diff(chosen.stems[valve]))),
        evidence=figures,
        profile=held.profile,
    )


def evidence_of(problem: Problem, found: Found, valve: int) -> dict[str, float]:
    """Return the named figures behind the verdict on one valve."""
    best, without = found.best, found.ideal
    count = problem.count * len(problem.pv)
    gain = without.loss - best.loss
    halves = half_gains(
        (_innovations(problem, one), _innovations(problem, other))
        for one, other in zip(best.fits, without.fits, strict=True)
    )
    return {
        "delta_bic": gain - 2.0 * float(np.log(count)),
        "free_run_ratio": _free_run(problem, without) / _free_run(problem, best),
        "half_1": halves[0],
        "half_2": halves[1],
        "share": float(best.friction[valve, 0] / problem.limit[valve]),
        "moves": float(np.count_nonzero(np.diff(best.stems[valve]))),
    }


def _innovations(problem: Problem, fit: OutputFit) -> FloatArray:
    return whitened(fit.noise, fit.rest, float(fit.rest[0]))[problem.first :]


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
    record: Record,
) -> tuple[Model, tuple[OrderRow, ...]]:
    """Return orders, delays and linear parts for the stems, and all orders that were tried."""
    friction = np.array([[v.static_friction, v.dynamic_friction] for v in valves])
    starts = np.array([v.stem_start for v in valves]) - record.op[0]
    stems = data.u.copy()
    for j in np.flatnonzero(friction[:, 0]):
        stems[j] = stem_of(data, int(j), friction[j], float(starts[j]))
    delays = ((data.delay[0],) * len(valves),) * len(data.y)
    base = Model(friction, starts, stems, delays, ())
    rivals = [(orders, linear_model(data, orders, base)) for orders in windows(options)]
    orders, best = min(rivals, key=lambda rival: rival[1].bic)
    model, _ = settle_delays(data, best, orders)
    return model, tuple(order_row(*rival) for rival in rivals)
