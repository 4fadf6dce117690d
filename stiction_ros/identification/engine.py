"""From a record to valves, outputs and verdicts: the order of the work."""

import dataclasses
import time

import numpy as np

from stiction_ros.identification.closed_loop.closed_loop import close_loop
from stiction_ros.identification.closed_loop.explanation import explained
from stiction_ros.identification.conclusion import BELIEVED, conclude, evidence, is_deadband, judge
from stiction_ros.identification.exact.intervals import friction_intervals
from stiction_ros.identification.exact.neighbourhood import REJECTED, refine
from stiction_ros.identification.exact.search import comb, improve, search
from stiction_ros.identification.identification_options import IdentificationOptions, Progress
from stiction_ros.identification.problem.models import (
    Data,
    Model,
    improve_delays,
    linear_model,
    refit,
    settle_delays,
    stem_of,
)
from stiction_ros.identification.problem.preparation import liveliest_part, prepare, windows
from stiction_ros.identification.result import (
    Identification,
    OrderRow,
    Stability,
    ValveEstimate,
    VerdictKind,
    halves,
)
from stiction_ros.identification.switching import require_cells
from stiction_ros.records.record import Record


def identify_exact(
    record: Record, options: IdentificationOptions, progress: Progress | None = None
) -> Identification:
    """Identify friction and linear dynamics of every valve and output of a record.

    Then every loop is closed again with what was found, which says why an output oscillates.

    Args:
        record: what was measured.
        options: of the search.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: a record that no model can be fitted to, an unknown law, or one whose switching
            patterns cannot be enumerated.
    """
    begun = time.perf_counter()
    report = progress or (lambda share: None)
    data = prepare(record, options)
    report(0.02)
    require_cells(data.law)
    part = liveliest_part(data)
    linear, found, pairs, table = choose(part, options)
    report(0.4)
    if part is not data:
        linear = linear_model(data, linear.orders)
    model = carried_over(data, linear, found)
    report(0.5)
    model, delays = settle_delays(data, model)
    valves, final = judged_valves(record, data, model, linear, options)
    report(1.0)
    exact = [certificate(valve) for valve in valves if valve.static_friction > 0.0]
    told = (*ambiguities(record, delays, pairs), *exact)
    plain = conclude(record, data, final, valves, table, told)
    answer = explained(record, plain, close_loop(record, plain))
    return dataclasses.replace(answer, seconds=time.perf_counter() - begun)


def judged_valves(
    record: Record, data: Data, model: Model, linear: Model, options: IdentificationOptions
) -> tuple[tuple[ValveEstimate, ...], Model]:
    """Return the estimates and the final model, judged against the friction-free rivals.

    Frictions are in the middle of their intervals. Those of a valve begin where the one before
    ends.
    """
    rivals = [linear_rivals(data, model, linear, j) for j in range(len(data.u))]
    valves = []
    for j in range(len(data.u)):
        intervals = friction_intervals(data, model, j, options.confidence)
        model = intervals.model
        span = float(np.ptp(data.u[j]))
        figures = evidence(model, rivals[j], j, span)
        figures["deadband_loss"] = intervals.deadband_loss
        doubted = figures["delta_bic"] <= BELIEVED
        static = (0.0, intervals.static[1]) if doubted else intervals.static
        dynamic = (0.0, intervals.dynamic[1]) if doubted else intervals.dynamic
        verdict = judge(figures, static, dynamic, span)
        healthy = verdict is VerdictKind.HEALTHY
        f_s, f_d = intervals.static_estimate, intervals.dynamic_estimate
        if doubted and (figures["delta_bic"] < 0.0 or healthy):
            f_s = f_d = 0.0
            model = without_friction(data, model, j)
        if record.stem is not None:
            error = model.stems[j] + record.op[:, j].mean() - record.stem[:, j]
            figures["stem_error"] = float(np.mean(error**2))
        figures["patterns"] = float(intervals.patterns)
        figures["patterns_closed"] = float(intervals.closed)
        gains = figures["half_1"], figures["half_2"]
        valve = ValveEstimate(
            name=record.valves[j],
            verdict=verdict,
            law=options.first_law,
            static_friction=f_s,
            static_interval=(min(static[0], f_s), max(static[1], f_s)),
            dynamic_friction=f_d,
            dynamic_interval=(min(dynamic[0], f_d), max(dynamic[1], f_d)),
            jump=0.0 if is_deadband(intervals.deadband_loss, static, dynamic) else f_s - f_d,
            stem_start=float(record.op[0, j] + model.start[j]),
            moves=int(np.count_nonzero(np.diff(model.stems[j]))),
            evidence=figures,
            stability=Stability(halves(gains, BELIEVED if healthy else None)),
        )
        valves.append(valve)
    return tuple(valves), model


def carried_over(data: Data, linear: Model, found: Model) -> Model:
    """Return the best model of the whole record near the friction found in a part of it.

    Args:
        linear: the whole record's model without friction.
        found: the part's model; its friction and delays are taken.
    """
    stems = linear.stems.copy()
    sticky = [int(j) for j in np.flatnonzero(found.friction[:, 0])]
    for j in sticky:
        stems[j] = stem_of(data, j, found.friction[j], 0.0)
    model = dataclasses.replace(
        linear,
        friction=found.friction,
        start=np.zeros(len(stems)),
        stems=stems,
        delays=found.delays,
    )
    model = refit(data, model, linear.orders, warm=False)
    for j in sticky:
        model = comb(data, model, j)
        model, _ = refine(data, model, j, REJECTED)
    return min(linear, model, key=lambda candidate: candidate.loss)


def choose(
    data: Data, options: IdentificationOptions
) -> tuple[Model, Model, tuple[tuple[int, int], ...], tuple[OrderRow, ...]]:
    """Return the models without and with friction, valves that do as well, and all orders tried."""
    orders_list = windows(options)
    start = orders_list[len(orders_list) // 2]
    linear = linear_model(data, start)
    found, pairs = search(data, linear)
    if len(orders_list) == 1:
        return linear, found, pairs, (order_row(found),)
    models = [linear_model(data, orders, found) for orders in orders_list]
    best = min(models, key=lambda rival: rival.bic)
    if best.orders != start:
        linear = linear_model(data, best.orders)
        found, pairs = search(data, linear, growing=False)
        best = improve(data, best)
    better = min(best, found, key=lambda candidate: candidate.loss)
    table = tuple(order_row(rival) for rival in models)
    return linear, better, pairs, table


def order_row(model: Model) -> OrderRow:
    """Return the criteria of a model by which orders are compared."""
    parameters = sum(fit.parameters for fit in model.fits)
    orders = model.orders
    return OrderRow(orders.output, orders.input, model.loss + 2.0 * parameters, model.bic)


def ambiguities(
    record: Record, delays: list[list[tuple[int, ...]]], valves: tuple[tuple[int, int], ...]
) -> tuple[str, ...]:
    """Return sentences on what explains the record equally well."""
    told = [
        f"delays {', '.join(map(str, near))} of {valve} to {output} explain the record equally well"
        for output, row in zip(record.outputs, delays, strict=True)
        for valve, near in zip(record.valves, row, strict=True)
        if len(near) > 1
    ]
    told += [
        f"friction in {record.valves[other]} explains the record as well as in "
        f"{record.valves[chosen]}"
        for chosen, other in valves
    ]
    return tuple(told)


def certificate(valve: ValveEstimate) -> str:
    """Return a sentence on what of a friction is exact and what was searched."""
    patterns = int(valve.evidence["patterns"])
    head = f"friction of {valve.name} (law {valve.law})"
    if not patterns:
        return f"{head}: searched on grids only, no switching pattern was enumerated"
    if valve.evidence["patterns_closed"]:
        reach = "exact among them, all at their edge are rejected"
    else:
        reach = "exact among them, but not all at their edge are rejected"
    return f"{head}: {patterns} switching patterns enumerated round it; {reach}"


def linear_rivals(data: Data, model: Model, linear: Model, valve: int) -> list[Model]:
    """Return models without friction in ``valve``, of three orders, with their own delays."""
    if model.friction[valve, 0] == 0.0:
        return [model]
    freed = without_friction(data, model, valve)
    own = dataclasses.replace(freed, delays=linear.delays)

    def of_order(extra: int) -> Model:
        orders = model.orders
        raised = dataclasses.replace(
            orders, output=orders.output + extra, input=orders.input + extra
        )
        known = raised == linear.orders and not freed.friction.any()
        return linear if known else refit(data, own, raised, warm=False)

    rivals = [freed, *map(of_order, (2, 1, 0))]
    best = min(rivals, key=lambda rival: rival.bic)
    return [*rivals, improve_delays(data, best)]


def without_friction(data: Data, model: Model, valve: int) -> Model:
    """Return the model, fitted again, with a valve that follows OP."""
    return refit(data, model.with_stem(valve, data.u[valve], 0.0, 0.0), model.orders)
