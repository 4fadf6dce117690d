"""A state-space model of a whole record: its delays, its order, remarks."""

import dataclasses
import functools
import os
import time

import numpy as np

from stiction_ros.checks import of_kind, one_of
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.identification_options import Progress
from stiction_ros.identification.linear.data import (
    LinearData,
    LinearStatus,
    OrderCriterion,
    prepare_linear,
)
from stiction_ros.identification.linear.result import LinearIdentification, in_engineering_units
from stiction_ros.identification.linear.subspace import OrderChoice, choose_order
from stiction_ros.intake.intake import record_of
from stiction_ros.records.record import Record
from stiction_ros.signals.arx import driven, fitted_free_run
from stiction_ros.signals.arx_fit import ArxOrders, stable_arx
from stiction_ros.signals.subspace_projection import SubspaceMethod
from stiction_ros.signals.tracking import explained

CONTROLLER_SHARE = 0.98
CLOSED_LOOP = (
    "the record has set-points, so a controller was at work; the method predictor allows for it",
)
ORDER = 2  # n_a and n_b of the ARX equations whose free runs tell the delays
MAX_RADIUS = 0.9995
"""Largest root of A: the pole of an integrator that is fitted lies as near to 1 as this."""
MARGIN = 2.0
"""Of delays whose log likelihoods, times −2, differ by less, the longest is kept."""


@dataclasses.dataclass(frozen=True)
class LinearOptions:
    """Options of :func:`fit_linear`.

    Attributes:
        order: n; None chooses.
        delay: inclusive range of t_d, samples.
        criterion: AIC or BIC, for an order that is not given.
        method: projection; ``predictor`` for records of a closed loop.

    Raises:
        InputError: an order or a delay out of range.

    Examples:
        >>> from stiction_ros import LinearOptions
        >>> LinearOptions(order=2).method.value
        'cva'
    """

    order: int | None = None
    delay: tuple[int, int] = (0, 0)
    criterion: OrderCriterion = OrderCriterion.BIC
    method: SubspaceMethod = SubspaceMethod.CVA

    def __post_init__(self) -> None:
        for key, kind in (("criterion", OrderCriterion), ("method", SubspaceMethod)):
            object.__setattr__(self, key, one_of(getattr(self, key), kind, key))
        if self.order is not None and not 1 <= self.order <= 100:
            raise InputError(f"{self.order} lies outside 1 to 100", where="order")
        low, high = self.delay
        if not 0 <= low <= high:
            raise InputError(
                f"{low}:{high} is no delay range", where="delay", fix="use LO:HI, 0 <= LO <= HI"
            )


def fit_linear(
    record: Record | str | os.PathLike[str],
    options: LinearOptions | None = None,
    stem: FloatArray | None = None,
    progress: Progress | None = None,
) -> LinearIdentification:
    """Fit a linear model of a record, without friction unless ``stem`` brings it.

    Args:
        record: what was measured, or the path of a file or bag of one loop.
        options: None for the defaults.
        stem: stem positions, shape (N, m), %, such as those of an identified friction; None
            takes OP.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: a record that no model can be fitted to.

    Returns:
        Fits, gains and poles with a status, and by ``loop_model`` the loop made of them.

    Examples:
        >>> from stiction_ros import LinearOptions, LoopModel, find_config
        >>> from stiction_ros import fit_linear, prbs_experiment
        >>> ideal = LoopModel.load(find_config("flow.loop.yaml")).with_ideal_valves()
        >>> record = prbs_experiment(ideal, samples=400, seed=1)
        >>> found = fit_linear(record, LinearOptions(order=1, delay=(0, 4)))
        >>> found.gain.round(2).tolist(), found.delay.tolist()  # 0.8 per %, 2 samples
        ([[0.8]], [[2]])
    """
    begun = time.perf_counter()
    record = record_of(record)
    options = LinearOptions() if options is None else of_kind(options, LinearOptions, "options")
    data = prepare_linear(record, stem)
    found = in_engineering_units(data, _best(data, options, progress), options.method)
    low, high = options.delay
    notes = tuple(
        f"the delay from valve {valve} to {output} is the longest tried; widen --delay"
        for i, output in enumerate(found.outputs)
        for j, valve in enumerate(found.valves)
        if found.delay[i, j] == high > low
    )
    if options.method is not SubspaceMethod.PREDICTOR and record.sp is not None:
        notes += CLOSED_LOOP
    shares = [explained(op, record.pv) for op in record.op.T]
    notes += tuple(
        f"a PI law of PV explains the moves of {valve} (R² {share:.3f}): the record tells no "
        "process from its controller, take one with set-point moves"
        for valve, share in zip(record.valves, shares, strict=True)
        if share > CONTROLLER_SHARE
    )
    seconds = time.perf_counter() - begun
    return dataclasses.replace(found, seconds=seconds, notes=(*record.notes, *notes))


def _best(data: LinearData, options: LinearOptions, progress: Progress | None) -> OrderChoice:
    """Return the better of the least delays and of those that ARX equations show."""
    low, high = options.delay
    tried = [(low,) * len(data.valves)]
    if high > low:  # of equations of second order, those whose free runs fit best
        rows = [_delays(data, output, low, high) for output in range(len(data.outputs))]
        tried.append(tuple(int(delay) for delay in np.min(rows, axis=0)))
    choices, longest = [], max(map(max, tried))
    for delay in tried:  # on one window
        late = longest - max(delay)
        part = dataclasses.replace(data, u=data.u[:, late:], y=data.y[:, late:])
        choices.append(choose_order(part, delay, options.order, options.method, options.criterion))
        if progress is not None:
            progress(len(choices) / len(tried))

    def rank(choice: OrderChoice) -> tuple[bool, float]:
        return choice.status is not LinearStatus.OK, choice.taken.value(options.criterion)

    return min(choices, key=rank)


def _delays(data: LinearData, output: int, low: int, high: int) -> tuple[int, ...]:
    """Return the delays to one output: one after the other is improved until none improves."""
    y, orders = data.y[output], ArxOrders(ORDER, ORDER, ORDER + high)
    target = y[orders.first :]

    @functools.cache
    def loss(delays: tuple[int, ...]) -> float:
        fit = stable_arx(y, data.u, delays, orders, radius=MAX_RADIUS)
        drive = driven(fit.b, delays, data.u, fit.constant)[orders.first :]
        missed = float(np.mean((target - fitted_free_run(fit.a, drive, target)) ** 2))
        return len(target) * float(np.log(max(missed, 1e-300)))

    before, delays = None, (low,) * len(data.valves)
    while delays != before:
        before = delays
        for j in range(len(delays)):
            rivals = [(*delays[:j], d, *delays[j + 1 :]) for d in range(low, high + 1)]
            delays = min(rivals, key=lambda rival: (loss(rival), rival))
    # A leading b near zero counts as delay.
    limit = loss(delays) + MARGIN
    for j in range(len(delays)):
        while delays[j] < high:
            longer = (*delays[:j], delays[j] + 1, *delays[j + 1 :])
            if loss(longer) > limit:
                break
            delays = longer
    return delays
