"""What the paper's two methods share: checks, Δu, delays to try, and the result."""

import dataclasses
import itertools

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.identification_options import limited
from stiction_ros.identification.linear.data import nrmse_fit
from stiction_ros.identification.problem import input_checks
from stiction_ros.identification.result import FitStatus, OutputModel, ValveEstimate, VerdictKind
from stiction_ros.paper.paper_options import PaperOptions
from stiction_ros.paper.search_log import PaperIdentification, SearchLog, SolvedStart
from stiction_ros.paper.smoothed_laws import smooth_law
from stiction_ros.records.record import Record
from stiction_ros.signals.arx_fit import ArxFit, ArxOrders, Delays, fit_arx
from stiction_ros.signals.holds import holds

SETTLED = 0.5  # share of a hold after which OP has settled
REPEATED = 0.5  # of the larger of two spans that come from the same cycle
PARTS = 8
MIN_PART = 4  # samples of a part that is looked at
DEFAULT_ORDER = 3
MIN_SAMPLES = 60
NO_EVIDENCE = (
    "this method gives the one best point: no interval and no verdict; as interval the whole "
    "range of friction stands, of which it rejects nothing"
)


def oscillation_spans(record: Record) -> FloatArray:
    """Return Δu of every valve, to which Section 3.2 limits friction, shape (m,), %.

    A record is cut where a set-point moves, else into eight parts. Of each hold the second half
    counts. Δu is the largest span that another one reaches by half: what comes once is a transient.
    Where no part repeats another it is the span of OP over the record.
    """
    rows = [] if record.sp is None else holds(record.sp)
    if len(rows) < 2:  # equal parts where no set-point moves, else the settled half of every hold
        edges = np.linspace(0, len(record), PARTS + 1).astype(int).tolist()
        rows = list(itertools.pairwise(edges))
    else:
        rows = [(begin + int(SETTLED * (end - begin)), end) for begin, end in rows]
    parts = [slice(begin, end) for begin, end in rows if end - begin >= MIN_PART]
    found = []
    for op in record.op.T:
        pairs = itertools.pairwise(
            sorted((float(np.ptp(op[part])) for part in parts), reverse=True)
        )
        repeated = (large for large, small in pairs if small >= REPEATED * large > 0.0)
        found.append(next(repeated, float(np.ptp(op))))
    return np.array(found)


@dataclasses.dataclass(frozen=True)
class Answer:
    """Where a method ended."""

    reason: str  # why the answer is not to be trusted; empty when it is
    friction: FloatArray  # rows (f_S, f_D), shape (m, 2), %
    delays: Delays  # t_d per output and valve, samples
    objective: float | None  # (12a) as the method has it; None where it came to nothing
    points: int  # frictions at which it was evaluated
    starts: tuple[SolvedStart, ...] = ()  # every run of a solver


def check_record(record: Record, options: PaperOptions) -> ArxOrders:
    """Return the orders and ε of a record that can be worked on; else InputError."""
    smooth_law(options.law)
    input_checks.require_signals(record)
    orders = orders_of(record, options)
    unknowns = orders.output + len(record.valves) * orders.input
    needed = orders.first + max(MIN_SAMPLES, 5 * (unknowns + 3))
    input_checks.require_samples(record, needed, input_checks.TOO_SHORT)
    return orders


def orders_of(record: Record, options: PaperOptions) -> ArxOrders:
    """Return the orders of a record, per channel where the options give them so, and ε."""
    m, p = len(record.valves), len(record.outputs)
    longest = [options.delay[1]] * m
    output = DEFAULT_ORDER if options.output_order is None else options.output_order
    past = output if options.input_order is None else options.input_order
    if isinstance(output, int) and isinstance(past, int):
        return ArxOrders.over(output, past, longest)
    outputs = (output,) * p if isinstance(output, int) else output
    rows = (past,) * p if isinstance(past, int) else past
    inputs = tuple((row,) * m if isinstance(row, int) else row for row in rows)
    if len(outputs) != p:
        raise InputError(f"{len(outputs)} orders n_a for {p} outputs", where="na")
    if len(inputs) != p or any(len(row) != m for row in inputs):
        raise InputError(f"orders n_b are not {p} rows of {m}, a row an output", where="nb")
    shared = ArxOrders.over(max(outputs), max(map(max, inputs)), longest)
    return dataclasses.replace(shared, channels=tuple(zip(outputs, inputs, strict=True)))


def evaluated(
    record: Record, options: PaperOptions, friction: FloatArray, delays: Delays
) -> "EquationError":
    """Return (12a) at a friction, rows (f_S, f_D), (m, 2), %, under the hard law of the options."""
    stems = smooth_law(options.law).hard_stems(record.op, np.asarray(friction, dtype=float))
    return fit_outputs(record.pv, stems, delays, orders_of(record, options))


def friction_limits(record: Record, options: PaperOptions) -> FloatArray:
    """Return f_max of every valve, shape (m,), %.

    It is Δu of the sustained oscillation unless the options give another, and never more than
    OP spans.
    """
    if options.friction_limit is None:
        return oscillation_spans(record)
    return limited(np.ptp(record.op, axis=0), options.friction_limit)


def delay_choices(record: Record, options: PaperOptions, most: int) -> list[Delays]:
    """Return all T^(m p) choices of delays, one delay per output and valve, ``most`` at most."""
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
    record: Record, options: PaperOptions, answer: Answer, seconds: float
) -> PaperIdentification:
    """Return the result of a one-step method in the form of all methods."""
    limits, orders = friction_limits(record, options), orders_of(record, options)
    found = evaluated(record, options, np.maximum(answer.friction, 0.0), answer.delays)
    stem = found.stems.T.copy()
    stem.flags.writeable = False
    outputs = tuple(
        output_model(record, i, fit, found.stems, orders) for i, fit in enumerate(found.fits)
    )
    notes = [*record.notes, NO_EVIDENCE]
    if options.friction_limit is None:
        spans = zip(record.valves, limits, strict=True)
        notes += [f"largest friction tried: Δu of {tag} {span:.3g} %" for tag, span in spans]
    if options.output_order is None:
        notes.append(f"orders were not given: n_a = {DEFAULT_ORDER} was taken")
    log = SearchLog(
        squared_error=found.squared_error,
        objective=found.squared_error if answer.objective is None else answer.objective,
        points=answer.points,
        starts=answer.starts,
    )
    low, high = options.delay
    notes += [
        f"the delay from valve {valve} to {output.name} is the longest tried; widen --delay"
        for output in outputs
        for valve, delay in output.delay.items()
        if delay == high > low
    ]
    return PaperIdentification(
        status=FitStatus.NO_MODEL if answer.reason else FitStatus.OK,
        reason=answer.reason,
        method=options.method,
        samples=len(record),
        sample_time=record.sample_time,
        seconds=seconds,
        valves=tuple(
            valve_estimate(
                record, j, answer.friction[j], found.stems[j], float(limits[j]), options.law
            )
            for j in range(len(record.valves))
        ),
        outputs=outputs,
        stem=stem,
        notes=tuple(notes),
        search=log,
    )


def valve_estimate(
    record: Record,
    valve: int,
    friction: FloatArray,
    stem: FloatArray,
    limit: float,
    law: str = "he",
) -> ValveEstimate:
    """Return a point estimate: undecided, with intervals from 0 to f_max, as f_D ≤ f_S."""
    static, dynamic = float(friction[0]), float(min(friction[0], friction[1]))
    moves = int(np.count_nonzero(np.abs(np.diff(stem)) > 1e-9 * max(limit, 1e-300)))
    return ValveEstimate(
        name=record.valves[valve],
        verdict=VerdictKind.UNDECIDED,
        law=law,
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
    record: Record, output: int, fit: ArxFit, stems: FloatArray, orders: ArxOrders
) -> OutputModel:
    """Return one output's model with its one-step and its free-run fit."""
    y = record.pv[:, output]
    first, tail = orders.first, y[orders.first :]
    past, inputs = orders.of_output(output, len(stems))
    free_parameters = past + sum(inputs) + 1
    variance = fit.squared_error / max(len(tail) - free_parameters, 1)
    return OutputModel(
        name=record.outputs[output],
        a=tuple(map(float, fit.a[:past])),
        b={
            tag: tuple(map(float, row[:width]))
            for tag, row, width in zip(record.valves, fit.b, inputs, strict=True)
        },
        delay=dict(zip(record.valves, fit.delays, strict=True)),
        bias=fit.constant,
        noise_std=float(np.sqrt(variance)),
        fit_one_step=nrmse_fit(tail, tail - fit.residuals),
        fit_free_run=nrmse_fit(tail, fit.free_run(y, stems, first)),
    )


@dataclasses.dataclass(frozen=True)
class EquationError:
    """The criterion of one record with its stems, shape (m, N), %, and an ARX model per output."""

    fits: tuple[ArxFit, ...]
    stems: FloatArray

    @property
    def squared_error(self) -> float:
        """Mean of SE over the outputs, (12a), squared engineering units."""
        return float(np.mean([fit.squared_error for fit in self.fits]))


def fit_outputs(
    pv: FloatArray, stems: FloatArray, delays: Delays, orders: ArxOrders
) -> EquationError:
    """Fit every output: PV, shape (N, p), of stems, shape (m, N), %, with t_d of each valve."""
    fits = tuple(
        fit_arx(y, stems, row, orders, orders.kept(i, len(stems)))
        for i, (y, row) in enumerate(zip(pv.T, delays, strict=True))
    )
    return EquationError(fits, stems)
