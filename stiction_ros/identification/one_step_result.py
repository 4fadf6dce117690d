"""What the paper's two methods share: checks, delays to try, and the result."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.equation_error import ArxFit, ArxOrders, Delays
from stiction_ros.identification.input_checks import (
    TOO_SHORT,
    require_samples,
    require_signals,
)
from stiction_ros.identification.linear_data import nrmse_fit
from stiction_ros.identification.options import IdentificationOptions
from stiction_ros.identification.results import (
    FitStatus,
    Identification,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.identification.search_log import SearchLog
from stiction_ros.records.record import Record

DEFAULT_ORDER = 3
MIN_SAMPLES = 60
NO_EVIDENCE = (
    "this method gives the one best point: no interval and no verdict; as interval the whole "
    "range of friction stands, of which it rejects nothing"
)


@dataclasses.dataclass(frozen=True)
class Answer:
    """Where a method ended.

    Attributes:
        status, reason: ok, or why the answer is not to be trusted.
        friction: rows (f_S, f_D), shape (m, 2), %.
        fits: the ARX model of every output.
        stems: stem positions that go with them, shape (m, N), %.
    """

    status: FitStatus
    reason: str
    friction: FloatArray
    fits: tuple[ArxFit, ...]
    stems: FloatArray


def check_record(record: Record, options: IdentificationOptions) -> ArxOrders:
    """Return the orders and ε of a record that can be worked on.

    Raises:
        InputError: a law that these methods do not have, no valve or output, a constant
            signal, or too few samples.
    """
    if options.law != "he":
        raise InputError(
            f"method {options.method} has no law {options.law!r}", where="law", fix="use he"
        )
    require_signals(record)
    output = DEFAULT_ORDER if options.output_order is None else options.output_order
    past = output if options.input_order is None else options.input_order
    orders = ArxOrders.over(output, past, [options.delay[1]] * len(record.valves))
    needed = orders.first + max(MIN_SAMPLES, 5 * (output + len(record.valves) * past + 3))
    require_samples(record, needed, TOO_SHORT)
    return orders


def friction_limits(record: Record, options: IdentificationOptions) -> FloatArray:
    """Return f_max = Δu of every valve, shape (m,), %, or the smaller limit of the options."""
    span = np.ptp(record.op, axis=0)
    if options.friction_limit is None:
        return np.asarray(span, dtype=float)
    return np.asarray(np.minimum(span, options.friction_limit), dtype=float)


def delay_choices(record: Record, options: IdentificationOptions, most: int) -> list[Delays]:
    """Return all T^(m p) choices of delays, one delay per output and valve.

    Raises:
        InputError: more than ``most`` choices.
    """
    low, high = options.delay
    channels = len(record.valves) * len(record.outputs)
    count = (high - low + 1) ** channels
    if count > most:
        raise InputError(
            f"{high - low + 1} delays on {channels} channels are {count} choices, "
            f"method {options.method} takes up to {most}",
            where="delay",
            fix="narrow the range",
        )
    width = len(record.valves)
    return [
        tuple(tuple(flat[i : i + width]) for i in range(0, channels, width))
        for flat in itertools.product(range(low, high + 1), repeat=channels)
    ]


def result(
    record: Record,
    options: IdentificationOptions,
    answer: Answer,
    log: SearchLog,
    seconds: float,
) -> Identification:
    """Return the result of a one-step method in the form of all methods."""
    limits = friction_limits(record, options)
    stem = answer.stems.T.copy()
    stem.flags.writeable = False
    outputs = tuple(
        output_model(record, i, fit, answer.stems, log.first) for i, fit in enumerate(answer.fits)
    )
    notes = [*record.notes, NO_EVIDENCE]
    if options.output_order is None:
        notes.append(f"orders were not given: n_a = {DEFAULT_ORDER} was taken")
    low, high = options.delay
    notes += [
        f"delay of {valve} to {output.name} is the longest tried, try a wider range"
        for output in outputs
        for valve, delay in output.delay.items()
        if delay == high > low
    ]
    return Identification(
        status=answer.status,
        reason=answer.reason,
        method=options.method,
        samples=len(record),
        sample_time=record.sample_time,
        seconds=seconds,
        valves=tuple(
            valve_estimate(record, j, answer.friction[j], answer.stems[j], float(limits[j]))
            for j in range(len(record.valves))
        ),
        outputs=outputs,
        stem=stem,
        notes=tuple(notes),
        search=log,
    )


def valve_estimate(
    record: Record, valve: int, friction: FloatArray, stem: FloatArray, limit: float
) -> ValveEstimate:
    """Return a point estimate: undecided, with intervals from 0 to the largest friction.

    f_D is at most f_S, so both intervals reach from 0 to f_max.
    """
    static, dynamic = float(friction[0]), float(min(friction[0], friction[1]))
    moves = int(np.count_nonzero(np.abs(np.diff(stem)) > 1e-9 * max(limit, 1e-300)))
    return ValveEstimate(
        name=record.valves[valve],
        verdict=VerdictKind.UNDECIDED,
        law="he",
        static_friction=static,
        static_interval=(0.0, max(limit, static)),
        dynamic_friction=dynamic,
        dynamic_interval=(0.0, max(limit, dynamic)),
        jump=static - dynamic,
        stem_start=float(record.op[0, valve]),
        moves=moves,
        evidence={"share": static / float(np.ptp(record.op[:, valve])), "moves": float(moves)},
    )


def output_model(
    record: Record, output: int, fit: ArxFit, stems: FloatArray, first: int
) -> OutputModel:
    """Return one output's model with its one-step and its free-run fit."""
    y = record.pv[:, output]
    tail = y[first:]
    free_parameters = len(fit.a) + fit.b.size + 1
    variance = fit.squared_error / max(len(tail) - free_parameters, 1)
    return OutputModel(
        name=record.outputs[output],
        a=tuple(map(float, fit.a)),
        b={tag: tuple(map(float, row)) for tag, row in zip(record.valves, fit.b, strict=True)},
        delay=dict(zip(record.valves, fit.delays, strict=True)),
        bias=fit.constant,
        noise_std=float(np.sqrt(variance)),
        fit_one_step=nrmse_fit(tail, tail - fit.residuals),
        fit_free_run=nrmse_fit(tail, fit.free_run(y, stems, first)),
    )
