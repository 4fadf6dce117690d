"""One face for the linear models of a whole record: ARX and state space."""

import dataclasses
import os
import time
from collections.abc import Callable

import numpy as np

from stiction_ros.checks import of_kind, one_of
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.linear.data import (
    LinearData,
    LinearKind,
    LinearStatus,
    OrderCriterion,
    prepare_linear,
)
from stiction_ros.identification.linear.orders import OrderChoice, OrderOptions, choose_orders
from stiction_ros.identification.linear.result import (
    LinearIdentification,
    arx_result,
    state_space_result,
)
from stiction_ros.identification.linear.subspace import (
    StateSpaceFit,
    SubspaceOptions,
    fit_state_space,
)
from stiction_ros.intake.intake import record_of
from stiction_ros.records.record import Record
from stiction_ros.signals.subspace_projection import SubspaceMethod
from stiction_ros.signals.velocity_form import explained

DEFAULT_ORDERS = (1, 2, 3)
CONTROLLER_SHARE = 0.98
CLOSED_LOOP = (
    "the record has set-points, so a controller was at work; the method predictor allows for it",
)
Progress = Callable[[float], None]


@dataclasses.dataclass(frozen=True)
class LinearOptions:
    """Options of :func:`fit_linear`.

    Attributes:
        kind: structure of the model.
        order: n of a state-space model; None chooses.
        output_order, input_order: n_a and n_b of ARX; None chooses n_a among 1, 2 and 3 and takes
            n_b = n_a.
        delay: inclusive range of t_d, samples.
        criterion: AIC or BIC, for every order that is not given.
        method: projection of the state-space model.

    Raises:
        InputError: orders that do not belong to the structure.

    Examples:
        >>> from stiction_ros import LinearOptions
        >>> LinearOptions(order=2).kind.value
        'state_space'
    """

    kind: LinearKind = LinearKind.STATE_SPACE
    order: int | None = None
    output_order: int | None = None
    input_order: int | None = None
    delay: tuple[int, int] = (0, 0)
    criterion: OrderCriterion = OrderCriterion.BIC
    method: SubspaceMethod = SubspaceMethod.CVA

    def __post_init__(self) -> None:
        for key, kind in (
            ("kind", LinearKind),
            ("criterion", OrderCriterion),
            ("method", SubspaceMethod),
        ):
            object.__setattr__(self, key, one_of(getattr(self, key), kind, key))
        space = self.kind is LinearKind.STATE_SPACE
        polynomial = (self.output_order, self.input_order)
        if space and any(value is not None for value in polynomial):
            raise InputError("n_a and n_b belong to arx", fix="give the order n")
        if not space and self.order is not None:
            raise InputError(f"{self.kind} has no order n", where="order", fix="give na and nb")

    def polynomial(self) -> OrderOptions:
        """Return what the orders of ARX are chosen from."""
        return OrderOptions(
            output=DEFAULT_ORDERS if self.output_order is None else (self.output_order,),
            input=() if self.input_order is None else (self.input_order,),
            delay=self.delay,
            criterion=self.criterion,
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
    report = progress or (lambda share: None)
    data = prepare_linear(record, stem)
    if options.kind is LinearKind.STATE_SPACE:
        found = state_space_result(data, _state_space(data, options))
    else:
        choices: list[OrderChoice] = []
        for i in range(len(data.outputs)):
            choices.append(choose_orders(data, i, options.polynomial()))
            report((i + 1) / len(data.outputs))
        found = arx_result(data, tuple(choices))
    report(1.0)
    low, high = options.delay
    notes = tuple(
        f"the delay from valve {valve} to {output} is the longest tried; widen --delay"
        for i, output in enumerate(found.outputs)
        for j, valve in enumerate(found.valves)
        if found.delay[i, j] == high > low
    )
    if options.kind is LinearKind.STATE_SPACE and options.method is not SubspaceMethod.PREDICTOR:
        notes += CLOSED_LOOP if record.sp is not None else ()
    shares = [explained(op, record.pv) for op in record.op.T]
    notes += tuple(
        f"a PI law of PV explains the moves of {valve} (R² {share:.3f}): the record tells no "
        "process from its controller, take one with set-point moves"
        for valve, share in zip(record.valves, shares, strict=True)
        if share > CONTROLLER_SHARE
    )
    seconds = time.perf_counter() - begun
    return dataclasses.replace(found, seconds=seconds, notes=(*record.notes, *notes))


def _state_space(data: LinearData, options: LinearOptions) -> StateSpaceFit:
    """Return the better of the least delays and of those that ARX equations show."""
    low, high = options.delay
    wanted = SubspaceOptions(
        order=options.order, method=options.method, criterion=options.criterion
    )
    tried = [(low,) * len(data.valves)]
    if high > low:
        rows = [
            choose_orders(data, i, OrderOptions(output=(2,), delay=options.delay)).fit.delays
            for i in range(len(data.outputs))
        ]
        # A delay belongs to the valve, so the output that answers first decides.
        tried.append(tuple(int(d) for d in np.min(rows, axis=0)))
    fits, longest = [], max(map(max, tried))
    for delay in tried:  # on one window
        late = longest - max(delay)
        part = dataclasses.replace(data, u=data.u[:, late:], y=data.y[:, late:])
        fits.append(fit_state_space(part, dataclasses.replace(wanted, delay=delay)))

    def rank(fit: StateSpaceFit) -> tuple[bool, float]:
        values = [row.value(options.criterion) for row in fit.rivals if row.order == fit.order]
        return fit.status is not LinearStatus.OK, min(values, default=float("inf"))

    return min(fits, key=rank)
