r"""State-space model of a linear record, OP (or stem) to PV, by a subspace method.

.. math::
    \xi_{k+1} &= A \xi_k + B (\chi_k - \chi_0) + K e_k \\
    y_k &= C \xi_k + y_0 + e_k

the process of (2) with an innovation e that makes the noise part of the model. With OP for χ
it is the model that a controller unaware of friction uses, as (A.3) is.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.linear.data import (
    LinearData,
    LinearStatus,
    OrderCriterion,
    information,
    nrmse_fit,
)
from stiction_ros.processes import LinearModel
from stiction_ros.signals.state_space_fit import (
    TINY,
    Realisation,
    predict,
    realise,
    realise_by_shift,
    refine,
    with_best_gain,
    with_initial_state,
)
from stiction_ros.signals.subspace_projection import StateSequence, SubspaceMethod, state_sequence

DEFAULT_HORIZON = 15  # block rows of past and future, samples, where the record allows it
MAX_ORDER = 8  # that is tried
UNSTABLE_MARGIN = 20.0
"""Lead of an unstable order in the criterion that casts doubt on the stable one taken."""


@dataclasses.dataclass(frozen=True)
class SubspaceOptions:
    """Options of :func:`fit_state_space`.

    Raises:
        InputError: an order or delay out of range.
    """

    # n; None takes the lowest criterion of the one-step error among stable models
    order: int | None = None
    # weighting; ``PREDICTOR`` for records of a closed loop
    method: SubspaceMethod = SubspaceMethod.CVA
    # samples by which every input is late before the states see it, one per valve; None is none.
    # Delays that are left out cost one state each
    delay: tuple[int, ...] | None = None
    criterion: OrderCriterion = OrderCriterion.BIC  # AIC or BIC, where the order is not given

    def __post_init__(self) -> None:
        if self.order is not None and not 1 <= self.order <= 100:
            raise InputError(f"{self.order} lies outside 1 to 100", where="order")
        if self.delay is not None and min(self.delay, default=0) < 0:
            raise InputError("a delay is negative", where="delay")


@dataclasses.dataclass(frozen=True)
class OrderRival:
    """One order that was tried."""

    order: int  # n
    # aic, bic: of the one-step error, N log det(covariance) + 2k or k log N with k = n (m + 2p) +
    # p; the outputs in units of their standard deviations
    aic: float
    bic: float
    fit_one_step: float  # fit_one_step, fit_free_run: mean over the outputs, %
    fit_free_run: float
    radius: float  # largest |λ| of A

    def value(self, criterion: OrderCriterion) -> float:
        """Return the criterion's value."""
        return self.aic if criterion is OrderCriterion.AIC else self.bic


@dataclasses.dataclass(frozen=True)
class StateSpaceFit:
    """A state-space model in engineering units; arrays read-only."""

    # ``OK``; ``CONSTRAINED`` where an unstable order does clearly better one step ahead;
    # ``UNSTABLE`` where |λ| ≥ 1; ``NO_MODEL`` where the states vanish
    status: LinearStatus
    reason: str  # one sentence; empty when ok
    # a, b, c, k: A (n, n), B (n, m) per %, C (p, n) and K (n, p), in engineering units
    a: FloatArray
    b: FloatArray
    c: FloatArray
    k: FloatArray
    x0: FloatArray  # state at the first sample after the delays, shape (n,)
    # stem0, pv0: operating point χ_0 (m,), % and y_0 (p,): the offset of the model
    stem0: FloatArray
    pv0: FloatArray
    delay: tuple[int, ...]  # samples, per valve, beside the one that B brings
    order: int  # n
    singular_values: FloatArray  # of the weighted projection, falling
    noise_std: FloatArray  # standard deviation of the one-step error per output, shape (p,)
    fit_one_step: FloatArray  # fit_one_step, fit_free_run: NRMSE fit per output, %, shape (p,)
    fit_free_run: FloatArray
    rivals: tuple[OrderRival, ...]  # the orders tried, with both fits
    method: SubspaceMethod  # the projection used

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A, largest first, shape (n,); the delays' zeros left out."""
        poles = np.linalg.eigvals(self.a).astype(complex)
        return poles[np.argsort(-np.abs(poles), kind="stable")]

    @property
    def gain(self) -> FloatArray:
        """C (I − A)⁻¹ B, shape (p, m), engineering units per %; the DC gain when stable."""
        return self.linear_model().gain

    def linear_model(self) -> LinearModel:
        """Return the model with its delays as further states, as processes and MPC take it."""
        n, m, extra = self.order, len(self.delay), sum(self.delay)
        a, b = np.zeros((n + extra, n + extra)), np.zeros((n + extra, m))
        a[:n, :n] = self.a
        first = n
        for j, delay in enumerate(self.delay):
            if delay == 0:
                b[:n, j] = self.b[:, j]
                continue
            last = first + delay - 1
            b[first, j] = 1.0
            a[first + 1 : last + 1, first:last] = np.eye(delay - 1)
            a[:n, last] = self.b[:, j]
            first = last + 1
        c = np.hstack([self.c, np.zeros((len(self.c), extra))])
        size = n + extra
        return LinearModel(a, b, c, np.zeros((size, 0)), np.zeros(size), self.stem0, self.pv0)


def fit_state_space(data: LinearData, options: SubspaceOptions | None = None) -> StateSpaceFit:
    """Fit a state-space model.

    In closed loop the noise comes back through OP: use ``SubspaceMethod.PREDICTOR`` there, and
    judge the model by its free run. A record without set-point moves may hold nothing of the
    process but the controller's inverse.

    Args:
        data: from :func:`stiction_ros.identification.linear.data.prepare_linear`.
        options: None for the defaults.

    Raises:
        InputError: a record too short for the order and horizon, or delays for another
            number of valves.
    """
    options = options or SubspaceOptions()
    m = len(data.u)
    delay = options.delay or (0,) * m
    if len(delay) != m:
        raise InputError(f"{len(delay)} delays for {m} valves", where="delay", fix=f"give {m}")
    u, y = _aligned(data, delay)
    horizon = _horizon(data, u.shape[1], options)
    # The shifted observability matrix must still show every state.
    most = options.order or min(MAX_ORDER, (horizon - 1) * len(y))
    sequence = state_sequence(u, y, horizon, most, options.method)
    if len(sequence.states) < (options.order or 1):
        return _no_model(data, delay, sequence, options)
    one_step = options.method is SubspaceMethod.PREDICTOR
    orders = [options.order] if options.order else range(1, len(sequence.states) + 1)
    fits = [_one_order(sequence, n, u, y, one_step) for n in orders]
    stable = [fit for fit in fits if fit[0].radius < 1.0]
    best = min(stable or fits, key=lambda fit: fit[1].value(options.criterion))
    status = _judge(best[1], [row for _, row in fits], options.criterion)
    found = _finish(data, delay, sequence, best[0], status, options.method)
    return dataclasses.replace(found, rivals=tuple(row for _, row in fits))


def _judge(
    taken: OrderRival, rivals: list[OrderRival], criterion: OrderCriterion
) -> tuple[LinearStatus, str]:
    """Return status and reason of the order taken."""
    if taken.radius >= 1.0:
        reason = f"largest pole |λ| = {taken.radius:.4f}; try another order"
        return LinearStatus.UNSTABLE, reason
    limit = taken.value(criterion) - UNSTABLE_MARGIN
    better = [str(row.order) for row in rivals if row.value(criterion) < limit]
    if better:
        reason = (
            f"order {', '.join(better)} fits one step ahead better but is unstable; the record "
            "may not tell the process from the controller"
        )
        return LinearStatus.CONSTRAINED, reason
    return LinearStatus.OK, ""


def _aligned(data: LinearData, delay: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Return inputs shifted by their delays, and the outputs beside them."""
    longest, count = max(delay), data.samples
    u = np.stack([row[longest - d : count - d] for row, d in zip(data.u, delay, strict=True)])
    return u, data.y[:, longest:]


def _horizon(data: LinearData, samples: int, options: SubspaceOptions) -> int:
    """Return block rows that the order needs and the record allows."""
    width, p = len(data.u) + len(data.y), len(data.y)
    least = -(-(options.order or 1) // p) + 1
    allowed = samples // (4 * width + 2)
    wanted = max(min(DEFAULT_HORIZON, allowed), least)
    if samples < 2 * wanted * (width + 1) + 10:
        raise InputError(
            f"{samples} samples are too few for a horizon of {wanted}",
            where=data.name,
            fix="take a longer record or a lower order",
        )
    return wanted


def _one_order(
    sequence: StateSequence, order: int, u: FloatArray, y: FloatArray, one_step: bool
) -> tuple[Realisation, OrderRival]:
    """Return the realisation by regression; that by shift where only this one is stable."""
    first = _scored(realise(sequence, order, u, y), sequence, u, y, one_step)
    if first[0].radius < 1.0:
        return first
    second = _scored(realise_by_shift(sequence, order, u, y), sequence, u, y, one_step)
    return second if second[0].radius < 1.0 else first


def _scored(
    model: Realisation, sequence: StateSequence, u: FloatArray, y: FloatArray, one_step: bool
) -> tuple[Realisation, OrderRival]:
    model = refine(with_best_gain(model, sequence, u, y), u, y, one_step)
    if model.radius >= 1.0 and not one_step:
        model = refine(model, u, y, True)
    model = with_initial_state(with_best_gain(model, sequence, u, y), u, y)
    p, first, order = len(y), sequence.horizon, len(model.a)
    ahead, free = (predict(model, u, y, flag) for flag in (True, False))
    with np.errstate(over="ignore", invalid="ignore"):
        left = (y - ahead)[:, first:]
        covariance = left @ left.T / left.shape[1] + TINY * np.eye(p)
    usable = bool(np.isfinite(covariance).all())
    spread = float(np.exp(np.linalg.slogdet(covariance)[1])) if usable else np.inf
    aic, bic = information(spread, left.shape[1], order * (len(u) + 2 * p) + p)
    fits = [
        float(np.mean([nrmse_fit(y[i, first:], run[i, first:]) for i in range(p)]))
        for run in (ahead, free)
    ]
    return model, OrderRival(order, aic, bic, fits[0], fits[1], model.radius)


def _finish(
    data: LinearData,
    delay: tuple[int, ...],
    sequence: StateSequence,
    model: Realisation,
    status: tuple[LinearStatus, str],
    method: SubspaceMethod,
) -> StateSpaceFit:
    """Return the model in engineering units, without its rivals."""
    u, y = _aligned(data, delay)
    one_step, free = (predict(model, u, y, flag) for flag in (True, False))
    first = sequence.horizon
    scores = [
        np.array([nrmse_fit(y[i, first:], run[i, first:]) for i in range(len(y))])
        for run in (one_step, free)
    ]
    return StateSpaceFit(
        status=status[0],
        reason=status[1],
        a=_fixed(model.a),
        b=_fixed(model.b / data.u_scale),
        c=_fixed(model.c * data.y_scale[:, None]),
        k=_fixed(model.k / data.y_scale),
        x0=_fixed(model.x0),
        stem0=_fixed(data.u_mean),
        pv0=_fixed(data.y_mean + data.y_scale * model.y0),
        delay=delay,
        order=len(model.a),
        singular_values=_fixed(sequence.singular_values),
        noise_std=_fixed((y - one_step)[:, first:].std(axis=1) * data.y_scale),
        fit_one_step=_fixed(scores[0]),
        fit_free_run=_fixed(scores[1]),
        rivals=(),
        method=method,
    )


def _no_model(
    data: LinearData, delay: tuple[int, ...], sequence: StateSequence, options: SubspaceOptions
) -> StateSpaceFit:
    m, p = len(data.u), len(data.y)
    nothing = np.full(p, -np.inf)
    return StateSpaceFit(
        status=LinearStatus.NO_MODEL,
        reason=f"the record shows {len(sequence.states)} states, not {options.order}",
        a=_fixed(np.zeros((0, 0))),
        b=_fixed(np.zeros((0, m))),
        c=_fixed(np.zeros((p, 0))),
        k=_fixed(np.zeros((0, p))),
        x0=_fixed(np.zeros(0)),
        stem0=_fixed(data.u_mean),
        pv0=_fixed(data.y_mean),
        delay=delay,
        order=0,
        singular_values=_fixed(sequence.singular_values),
        noise_std=_fixed(data.y_scale),
        fit_one_step=_fixed(nothing),
        fit_free_run=_fixed(nothing),
        rivals=(),
        method=options.method,
    )


def _fixed(values: FloatArray) -> FloatArray:
    out = np.array(values, dtype=float)
    out.flags.writeable = False
    return out
