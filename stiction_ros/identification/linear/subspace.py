r"""State-space models of a linear record, OP (or stem) to PV, of every order that is tried.

.. math::
    \xi_{k+1} &= A \xi_k + B (\chi_k - \chi_0) + K e_k \\
    y_k &= C \xi_k + y_0 + e_k

the process of (2) with an innovation e that makes the noise part of the model. With OP for χ
it is the model that a controller unaware of friction uses, as (A.3) is.
"""

import dataclasses
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.linear.data import (
    LinearData,
    LinearStatus,
    OrderCriterion,
    nrmse_fit,
)
from stiction_ros.signals.state_space_fit import (
    TINY,
    Realisation,
    predict,
    realise,
    refine,
    with_best_gain,
)
from stiction_ros.signals.subspace_projection import StateSequence, SubspaceMethod, state_sequence

DEFAULT_HORIZON = 15  # block rows of past and future, samples, where the record allows it
MAX_ORDER = 8  # that is tried
UNSTABLE_MARGIN = 20.0
"""Lead of an unstable order in the criterion that casts doubt on the stable one taken."""


@dataclasses.dataclass(frozen=True)
class OrderRival:
    """The model of one order that was tried."""

    model: Realisation  # of centred, scaled data
    # aic, bic: of the one-step error, N log det(covariance) + 2k or k log N with k = n (m + 2p) +
    # p; the outputs in units of their standard deviations
    aic: float
    bic: float
    fit_one_step: FloatArray  # fit_one_step, fit_free_run: NRMSE fit per output, %, shape (p,)
    fit_free_run: FloatArray
    noise_std: FloatArray  # of the one-step error per output, scaled, shape (p,)

    @property
    def order(self) -> int:
        """Number n of states."""
        return len(self.model.a)

    def value(self, criterion: OrderCriterion) -> float:
        return self.aic if criterion is OrderCriterion.AIC else self.bic

    def to_dict(self) -> dict[str, Any]:
        """Return an entry of ``rivals`` of ``fit-linear --json``; fits are means over outputs."""
        return {
            "order": self.order,
            "aic": self.aic,
            "bic": self.bic,
            "fit_one_step": float(self.fit_one_step.mean()),
            "fit_free_run": float(self.fit_free_run.mean()),
            "radius": self.model.radius,
        }


@dataclasses.dataclass(frozen=True)
class OrderChoice:
    """The order taken, and all that were tried, for one choice of delays."""

    delay: tuple[int, ...]  # samples, per valve, beside the one that B brings
    taken: OrderRival
    rivals: tuple[OrderRival, ...]
    singular_values: FloatArray  # of the weighted projection, falling
    status: LinearStatus
    reason: str  # one sentence; empty when ok


def choose_order(
    data: LinearData,
    delay: tuple[int, ...],
    order: int | None,
    method: SubspaceMethod,
    criterion: OrderCriterion,
) -> OrderChoice:
    """Choose the order of a state-space model.

    Args:
        data: from :func:`stiction_ros.identification.linear.data.prepare_linear`.
        delay: samples by which every input is late before the states see it, one per valve.
            Delays that are left out cost one state each.
        order: n; None takes the lowest criterion of the one-step error among stable models.
        method: of the projection; ``PREDICTOR`` for records of a closed loop.
        criterion: AIC or BIC, where the order is not given.

    Raises:
        InputError: a record too short for the order and horizon, or of fewer states.
    """
    longest, count = max(delay), data.samples
    u = np.stack([row[longest - d : count - d] for row, d in zip(data.u, delay, strict=True)])
    y = data.y[:, longest:]
    horizon = _horizon(data, u.shape[1], order)
    # The past must still show every state.
    most = order or min(MAX_ORDER, (horizon - 1) * len(y))
    sequence = state_sequence(u, y, horizon, most, method)
    shown = len(sequence.states)
    if shown < (order or 1):
        said = f"the record shows {shown} states, not {order}"
        raise InputError(said, where=data.name, fix="take a lower order")
    one_step = method is SubspaceMethod.PREDICTOR
    orders = [order] if order else range(1, shown + 1)
    rivals = [_rival(sequence, n, u, y, one_step) for n in orders]
    stable = [rival for rival in rivals if rival.model.radius < 1.0]
    taken = min(stable or rivals, key=lambda rival: rival.value(criterion))
    status, reason = _judge(taken, rivals, criterion)
    return OrderChoice(delay, taken, tuple(rivals), sequence.singular_values, status, reason)


def _judge(
    taken: OrderRival, rivals: list[OrderRival], criterion: OrderCriterion
) -> tuple[LinearStatus, str]:
    if taken.model.radius >= 1.0:
        reason = f"largest pole |λ| = {taken.model.radius:.4f}; try another order"
        return LinearStatus.UNSTABLE, reason
    limit = taken.value(criterion) - UNSTABLE_MARGIN
    better = [str(rival.order) for rival in rivals if rival.value(criterion) < limit]
    if better:
        reason = (
            f"order {', '.join(better)} fits one step ahead better but is unstable; the record "
            "may not tell the process from the controller"
        )
        return LinearStatus.CONSTRAINED, reason
    return LinearStatus.OK, ""


def _horizon(data: LinearData, samples: int, order: int | None) -> int:
    """Return block rows that the order needs and the record allows."""
    width, p = len(data.u) + len(data.y), len(data.y)
    least = -(-(order or 1) // p) + 1
    allowed = samples // (4 * width + 2)
    wanted = max(min(DEFAULT_HORIZON, allowed), least)
    if samples < 2 * wanted * (width + 1) + 10:
        raise InputError(
            f"{samples} samples are too few for a horizon of {wanted}",
            where=data.name,
            fix="take a longer record or a lower order",
        )
    return wanted


def _rival(
    sequence: StateSequence, order: int, u: FloatArray, y: FloatArray, one_step: bool
) -> OrderRival:
    model = realise(sequence, order, u, y)
    model = refine(with_best_gain(model, sequence, u, y), u, y, one_step)
    if model.radius >= 1.0 and not one_step:
        model = refine(model, u, y, True)
    model = with_best_gain(model, sequence, u, y)
    p, first = len(y), sequence.horizon
    ahead, free = (predict(model, u, y, flag) for flag in (True, False))
    with np.errstate(over="ignore", invalid="ignore"):
        left = (y - ahead)[:, first:]
        covariance = left @ left.T / left.shape[1] + TINY * np.eye(p)
        noise = left.std(axis=1)
    likelihood, parameters = np.inf, order * (len(u) + 2 * p) + p
    if np.isfinite(covariance).all():
        spread = float(np.exp(np.linalg.slogdet(covariance)[1]))
        likelihood = left.shape[1] * float(np.log(max(spread, 1e-300)))
    fits = [
        np.array([nrmse_fit(y[i, first:], run[i, first:]) for i in range(p)])
        for run in (ahead, free)
    ]
    aic = likelihood + 2.0 * parameters
    bic = likelihood + parameters * float(np.log(left.shape[1]))
    return OrderRival(model, aic, bic, fits[0], fits[1], noise)
