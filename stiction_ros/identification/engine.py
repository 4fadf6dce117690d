"""From a record to valves, outputs and verdicts: the order of the work."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.friction_grid import find_law
from stiction_ros.identification.intervals import friction_intervals
from stiction_ros.identification.models import (
    Data,
    Model,
    improve_delays,
    linear_model,
    refit,
    settle_delays,
)
from stiction_ros.identification.options import IdentificationOptions
from stiction_ros.identification.output_error import Orders, OutputFit
from stiction_ros.identification.results import (
    FitStatus,
    Identification,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.identification.search import search
from stiction_ros.identification.verdict import evidence, judge
from stiction_ros.records.record import Record

METHOD = "exact"
MIN_SAMPLES = 60
DEFAULT_ORDERS = (1, 2, 3)
Progress = Callable[[float], None]


def identify(
    record: Record,
    options: IdentificationOptions | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify friction and linear dynamics of every valve and output of a record.

    Args:
        record: what was measured.
        options: None for the defaults.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: a record that no model can be fitted to, or an unknown law.
    """
    begun = time.perf_counter()
    options = options or IdentificationOptions()
    report = progress or (lambda share: None)
    data = prepare(record, options)
    report(0.02)
    orders, linear, model = choose(data, options, len(record))
    report(0.6)
    model = settle_delays(data, model, orders)
    rivals = [linear_rivals(data, model, linear, orders, j) for j in range(len(data.u))]
    report(0.8)
    valves, model = estimate_valves(record, data, model, orders, rivals, options)
    report(1.0)
    return finish(record, data, model, valves, begun)


def prepare(record: Record, options: IdentificationOptions) -> Data:
    """Return the centred, scaled data; raise :class:`InputError` when they are unusable."""
    for key, values, tags in (
        ("op", record.op, record.valves),
        ("pv", record.pv, record.outputs),
    ):
        for column, tag in enumerate(tags):
            part = values[:, column]
            if len(part) and np.ptp(part) <= 1e-9 * max(1.0, float(np.abs(part).max())):
                raise InputError(
                    f"{key} of {tag} is constant",
                    where=record.name,
                    fix="choose a window in which the loop moves",
                )
    if not record.valves or not record.outputs:
        raise InputError("needs at least one valve and one output", where=record.name)
    orders = window(options, max(_orders(options)), _input_order(options, max(_orders(options))))
    free = 2 * orders.output + len(record.valves) * orders.input + orders.noise + 3
    needed = orders.first + max(MIN_SAMPLES, 5 * free)
    if len(record) < needed:
        raise InputError(
            f"{len(record)} samples are too few, {needed} are needed",
            where=record.name,
            fix="take a longer record, lower orders or a narrower delay range",
        )
    u, y = record.op.T, record.pv.T
    span = np.ptp(u, axis=1)
    limit = span if options.friction_limit is None else np.minimum(span, options.friction_limit)
    return Data(
        y=(y - y.mean(axis=1, keepdims=True)) / y.std(axis=1, keepdims=True),
        u=u - u.mean(axis=1, keepdims=True),
        law=find_law(options.law),
        limit=limit,
        delay=options.delay,
        min_moves=options.min_moves,
    )


def _orders(options: IdentificationOptions) -> tuple[int, ...]:
    return DEFAULT_ORDERS if options.output_order is None else (options.output_order,)


def _input_order(options: IdentificationOptions, output_order: int) -> int:
    return output_order if options.input_order is None else options.input_order


def window(options: IdentificationOptions, output_order: int, input_order: int) -> Orders:
    """Return orders with the one window that suits all rivals of this identification."""
    largest = max(_orders(options)) + 2
    largest_input = _input_order(options, max(_orders(options))) + 2
    first = options.delay[1] + 2 * largest_input + largest + options.noise_order + 1
    return Orders(output_order, input_order, options.noise_order, first)


def choose(data: Data, options: IdentificationOptions, samples: int) -> tuple[Orders, Model, Model]:
    """Return the orders, the friction-free model and the model with friction."""
    orders_list = [window(options, n, _input_order(options, n)) for n in _orders(options)]
    start = orders_list[len(orders_list) // 2]
    linear = linear_model(data, start)
    model = search(data, linear, start)
    if len(orders_list) == 1:
        return start, linear, model
    rivals = [(orders, linear_model(data, orders, model)) for orders in orders_list]
    orders, best = min(rivals, key=lambda rival: rival[1].bic)
    if orders == start:
        return start, linear, min(best, model, key=lambda candidate: candidate.loss)
    linear = linear_model(data, orders)
    again = search(data, linear, orders)
    return orders, linear, min(best, again, key=lambda candidate: candidate.loss)


def linear_rivals(
    data: Data, model: Model, linear: Model, orders: Orders, valve: int
) -> list[Model]:
    """Return models without friction in ``valve``, of three orders, with their own delays."""
    if model.friction[valve, 0] == 0.0:
        return [model]
    freed = without_friction(data, model, orders, valve)
    rivals = [freed]
    for extra in range(3):
        raised = dataclasses.replace(
            orders, output=orders.output + extra, input=orders.input + extra
        )
        own = dataclasses.replace(freed, delays=linear.delays)
        rivals.append(refit(data, own, raised, warm=False))
    best = min(rivals, key=lambda rival: rival.bic)
    return [*rivals, improve_delays(data, best, best.fits[0].orders)]


def estimate_valves(
    record: Record,
    data: Data,
    model: Model,
    orders: Orders,
    rivals: list[list[Model]],
    options: IdentificationOptions,
) -> tuple[tuple[ValveEstimate, ...], Model]:
    """Return the estimates and the final model, frictions in the middle of their intervals."""
    found = []
    for j in range(len(data.u)):
        intervals = friction_intervals(data, model, orders, j, options.confidence)
        model = intervals.model
        span = float(np.ptp(data.u[j]))
        figures = evidence(data, model, rivals[j], j, span)
        doubted = figures["delta_bic"] <= options.bic_margin
        static = (0.0, intervals.static[1]) if doubted else intervals.static
        dynamic = (0.0, intervals.dynamic[1]) if doubted else intervals.dynamic
        verdict = judge(figures, static, span, options)
        estimate = (intervals.static_estimate, intervals.dynamic_estimate)
        if doubted and (figures["delta_bic"] < 0.0 or verdict is VerdictKind.HEALTHY):
            estimate = (0.0, 0.0)
            model = without_friction(data, model, orders, j)
        figures["deadband_loss"] = intervals.deadband_loss
        found.append((estimate, static, dynamic, verdict, figures))
    valves = tuple(_valve(record, model, j, *entry, options.law) for j, entry in enumerate(found))
    return valves, model


def without_friction(data: Data, model: Model, orders: Orders, valve: int) -> Model:
    """Return the model, fitted again, with a valve that follows OP."""
    friction, start, stems = model.friction.copy(), model.start.copy(), model.stems.copy()
    friction[valve], start[valve], stems[valve] = 0.0, 0.0, data.u[valve]
    return refit(
        data, dataclasses.replace(model, friction=friction, start=start, stems=stems), orders
    )


def _valve(
    record: Record,
    model: Model,
    j: int,
    estimate: tuple[float, float],
    static: tuple[float, float],
    dynamic: tuple[float, float],
    verdict: VerdictKind,
    figures: dict[str, float],
    law: str,
) -> ValveEstimate:
    f_s, f_d = estimate
    return ValveEstimate(
        name=record.valves[j],
        verdict=verdict,
        law=law,
        static_friction=f_s,
        static_interval=(min(static[0], f_s), max(static[1], f_s)),
        dynamic_friction=f_d,
        dynamic_interval=(min(dynamic[0], f_d), max(dynamic[1], f_d)),
        jump=0.0 if figures["deadband_loss"] < 4.0 else f_s - f_d,
        stem_start=float(record.op[0, j] + model.start[j]),
        moves=int(np.count_nonzero(np.diff(model.stems[j]))),
        evidence=figures,
    )


def finish(
    record: Record,
    data: Data,
    model: Model,
    valves: tuple[ValveEstimate, ...],
    begun: float,
) -> Identification:
    """Return the result in engineering units."""
    stem = model.stems.T + record.op.mean(axis=0)
    stem.flags.writeable = False
    outputs = tuple(output_model(record, i, fit, data) for i, fit in enumerate(model.fits))
    notes = list(record.notes)
    for j, tag in enumerate(record.valves):
        if record.op[:, j].min() < 0.0 or record.op[:, j].max() > 100.0:
            notes.append(f"op of {tag} lies outside 0 to 100 %; friction is in the op's own units")
    notes += [
        f"delay of {valve} to {output.name} is the longest tried, try a wider range"
        for output in outputs
        for valve, delay in output.delay.items()
        if delay == data.delay[1] > data.delay[0]
    ]
    usable = all(np.isfinite(fit.loss) for fit in model.fits)
    return Identification(
        status=FitStatus.OK if usable else FitStatus.NO_MODEL,
        reason="" if usable else "no output could be fitted",
        method=METHOD,
        samples=len(record),
        sample_time=record.sample_time,
        seconds=time.perf_counter() - begun,
        valves=valves,
        outputs=outputs,
        stem=stem,
        notes=tuple(notes),
    )


def output_model(record: Record, i: int, fit: OutputFit, data: Data) -> OutputModel:
    """Return one output's model in engineering units, equation (9) with a constant."""
    mean, scale = float(record.pv[:, i].mean()), float(record.pv[:, i].std())
    b = fit.b * scale
    bias = fit.constant * scale + float(fit.a.sum()) * mean
    bias -= float(b.sum(axis=1) @ record.op.mean(axis=0))
    y = data.y[i]
    free = fit_percent(y[len(y) - len(fit.free_run) :], fit.free_run)
    tail = y[len(y) - fit.count :]
    return OutputModel(
        name=record.outputs[i],
        a=tuple(float(value) for value in fit.a[1:]),
        b={tag: tuple(map(float, row)) for tag, row in zip(record.valves, b, strict=True)},
        delay=dict(zip(record.valves, fit.delays, strict=True)),
        bias=bias,
        noise_std=float(np.sqrt(fit.energy / max(fit.count - fit.parameters, 1))) * scale,
        fit_one_step=fit_percent(tail, tail - fit.innovations),
        fit_free_run=free,
    )


def fit_percent(y: FloatArray, predicted: FloatArray) -> float:
    """Return the NRMSE fit 100 (1 − ‖y − ŷ‖ / ‖y − mean y‖), %."""
    spread = float(np.linalg.norm(y - y.mean()))
    return 100.0 * (1.0 - float(np.linalg.norm(y - predicted)) / max(spread, 1e-300))
