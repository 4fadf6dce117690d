"""Identification by evidence: friction first, under any smooth process, then the process."""

import dataclasses
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.closed_loop.closed_loop import close_loop
from stiction_ros.identification.closed_loop.explanation import explained
from stiction_ros.identification.conclusion import conclude, half_gains, is_deadband
from stiction_ros.identification.engine import order_row
from stiction_ros.identification.evidence.accepted import Unseen
from stiction_ros.identification.evidence.further import with_further
from stiction_ros.identification.evidence.laws import with_own_laws
from stiction_ros.identification.evidence.measured_figures import (
    figures_of,
    loss_without_response,
    responds,
)
from stiction_ros.identification.evidence.rates import (
    ALIKE,
    PRICE,
    Agreement,
    Look,
    agreement,
    liveliest,
    looks,
)
from stiction_ros.identification.evidence.sensor_hold import hold_notes
from stiction_ros.identification.friction import find_law, simulate
from stiction_ros.identification.identification_options import IdentificationOptions, Progress
from stiction_ros.identification.judgement import Figures, friction_probability, verdict_of
from stiction_ros.identification.problem.models import (
    Data,
    Model,
    linear_model,
    refit,
    settle_delays,
)
from stiction_ros.identification.problem.preparation import prepare, windows
from stiction_ros.identification.result import (
    Identification,
    Stability,
    ValveEstimate,
    VerdictKind,
    halves,
)
from stiction_ros.identification.result import Look as View
from stiction_ros.records.record import Record
from stiction_ros.signals.autoregression import innovations


def identify_by_evidence(
    record: Record, options: IdentificationOptions, progress: Progress | None = None
) -> Identification:
    """Identify friction by its evidence, and linear dynamics for the stems that it gives.

    Args:
        record: what was measured.
        options: of ``delay`` the lower end alone plays a part in the
            search for friction, which needs no order either.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: a record that no model can be fitted to, or an unknown law.
    """
    begun = time.perf_counter()
    report = progress or (lambda share: None)
    data = prepare(record, options)
    report(0.02)
    part = liveliest(record)
    seen, told = with_own_laws(looks(part, options), options)
    report(0.7)
    found = concluded(record, data, part, seen, options)
    report(1.0)
    notes = [
        f"friction of {v}: {said}" for v, said in zip(record.valves, told, strict=True) if said
    ]
    found = dataclasses.replace(found, notes=(*found.notes, *hold_notes(part), *notes))
    return dataclasses.replace(found, seconds=time.perf_counter() - begun)


def concluded(
    record: Record, data: Data, part: Record, seen: tuple[Look, ...], options: IdentificationOptions
) -> Identification:
    """Return process, probabilities, verdicts and causes by what the rates show.

    Args:
        record, data: the whole, and made ready.
        part: of it that was searched.
        seen: each rate of that.
        options: of the search.
    """
    agreed = tuple(agreement(seen, j) for j in range(len(part.valves)))
    best = tuple(_estimate(part, one, j, options) for j, one in enumerate(agreed))
    found = _identification(record, data, part, options, best)
    closed = close_loop(record, found)
    silent = [[loss_without_response(look, j) for look in seen] for j in range(len(agreed))]
    told = [figures_of(seen, silent[j], one, j, closed) for j, one in enumerate(agreed)]
    best = tuple(
        dataclasses.replace(one, responds=responds(seen, silent[j], j, options.confidence))
        for j, one in enumerate(best)
    )
    judged = tuple(
        _judged(estimate, figures, partial(_stability, seen, one, j, record.sample_time))
        for j, (estimate, figures, one) in enumerate(zip(best, told, agreed, strict=True))
    )
    if any(valve.verdict is VerdictKind.HEALTHY for valve in judged):
        found = _identification(record, data, part, options, judged)
        closed = close_loop(record, found)
    found = explained(record, dataclasses.replace(found, valves=judged), closed)
    surest = max(agreed, key=lambda one: one.gain)
    return dataclasses.replace(found, row_samples=surest.look.problem.rate)


def _identification(
    record: Record,
    data: Data,
    part: Record,
    options: IdentificationOptions,
    valves: tuple[ValveEstimate, ...],
) -> Identification:
    """Return the process for the stems of these valves, over the whole record.

    Orders and delays are those of the part. Where the stems were before the part is not known:
    over the whole they begin at OP.
    """
    small = data if part is record else prepare(part, options)
    friction = np.array([[v.static_friction, v.dynamic_friction] for v in valves])
    starts = np.array([v.stem_start for v in valves]) - part.op[0]
    delays = ((small.delay[0],) * len(valves),) * len(small.y)
    base = Model(friction, starts, _stems(small, valves, starts), delays, ())
    rivals = [linear_model(small, orders, base) for orders in windows(options)]
    model, _ = settle_delays(small, min(rivals, key=lambda rival: rival.bic))
    if part is not record:
        valves = tuple(
            dataclasses.replace(valve, stem_start=float(op))
            for valve, op in zip(valves, record.op[0], strict=True)
        )
        nowhere = np.zeros(len(valves))
        whole = dataclasses.replace(model, start=nowhere, stems=_stems(data, valves, nowhere))
        model = refit(data, whole, model.orders, warm=False)
    table = tuple(order_row(rival) for rival in rivals)
    return dataclasses.replace(conclude(record, data, model, valves, table), method="evidence")


def _estimate(
    record: Record, agreed: Agreement, valve: int, options: IdentificationOptions
) -> ValveEstimate:
    """Return the friction of one valve that explains the record best, not yet judged."""
    problem, found = agreed.look.problem, agreed.look.found
    span = float(problem.span[valve])
    held, chosen = agreed.look.accepted[valve].times(span), found.best
    unseen = Unseen.of(span * problem.op[valve])
    static, dynamic = (span * float(value) for value in chosen.friction[valve])
    deadband = is_deadband(held.deadband_loss, held.static, held.dynamic)
    estimate = ValveEstimate(
        name=record.valves[valve],
        verdict=VerdictKind.UNDECIDED,
        law=str(problem.laws[valve].law),
        static_friction=static,
        static_interval=unseen.static(held.static),
        dynamic_friction=dynamic,
        dynamic_interval=unseen.dynamic(held.dynamic),
        band_interval=unseen.band(held.band),
        jump=0.0 if deadband else static - dynamic,
        stem_start=float(record.op[0, valve]) + span * float(chosen.starts[valve]),
        moves=int(np.count_nonzero(np.diff(chosen.stems[valve]))),
        evidence={},
    )
    return with_further(estimate, problem, found, valve, options.confidence)


def _judged(
    estimate: ValveEstimate, figures: Figures, stability: Callable[[bool], Stability]
) -> ValveEstimate:
    """Return the estimate with its probability and verdict, and how that holds.

    Where friction is not sure the intervals begin at 0; a healthy valve has none.
    """
    probability = friction_probability(figures)
    verdict = verdict_of(probability, estimate.responds, estimate.jump == 0.0)
    judged = dataclasses.replace(
        estimate,
        verdict=verdict,
        probability=probability,
        figures=figures,
        evidence=figures.to_dict(),
        stability=stability(verdict is VerdictKind.HEALTHY),
    )
    if verdict.has_friction:
        return judged
    band = judged.sum_interval
    judged = dataclasses.replace(
        judged,
        static_interval=(0.0, judged.static_interval[1]),
        dynamic_interval=(0.0, judged.dynamic_interval[1]),
        band_interval=(0.0, band[1]),
    )
    if verdict is VerdictKind.UNDECIDED:
        return judged
    return dataclasses.replace(judged, static_friction=0.0, dynamic_friction=0.0, jump=0.0, moves=0)


def _stability(
    seen: tuple[Look, ...], agreed: Agreement, valve: int, sample_time: float, healthy: bool
) -> Stability:
    """Return what every rate and both halves say; ``sample_time`` in s."""
    band = agreed.look.accepted[valve].band
    views = []
    for look in seen:
        held = look.accepted[valve]
        near = max(band[0], held.band[0]) <= ALIKE * min(band[1], held.band[1])
        finds = look.beyond_price(valve) > 0.0
        agrees = not finds if healthy else finds and near
        name = f"rows of {look.problem.rate * sample_time:g} s"
        shown = held.times(float(look.problem.span[valve]))
        views.append(View(name, held.gain, agrees, shown.band))
    best, without = agreed.look.found.best, agreed.look.found.without[valve]
    first = agreed.look.problem.first
    gains = half_gains(
        (innovations(one.noise, one.rest)[first:], innovations(other.noise, other.rest)[first:])
        for one, other in zip(best.fits, without.fits, strict=True)
    )
    return Stability((*views, *halves(gains, PRICE if healthy else None)))


def _stems(data: Data, valves: tuple[ValveEstimate, ...], starts: FloatArray) -> FloatArray:
    """Return the stems of valves, each by its own law, shape (m, N)."""
    stems = data.u.copy()
    for j, valve in enumerate(valves):
        if valve.static_friction > 0.0:
            law, op = find_law(valve.law), data.u[j]
            friction = np.array([[valve.static_friction, valve.dynamic_friction]])
            further = valve.further_values
            stems[j] = simulate(law, friction, op, float(op[0] + starts[j]), further)[:, 0]
    return stems
