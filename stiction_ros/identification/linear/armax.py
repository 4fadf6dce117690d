r"""ARMAX and ARX equations of one output from given stems, by the one-step error.

.. math:: A(q) y_k = \sum_j B_j(q) \chi^{(j)}_k + c + C(q) e_k

A and B_j as in (8a), (8b), with the delays in B_j and a constant c always; C monic, of order
n_c, its roots inside the unit circle. n_c = 0 is the ARX equation (9).
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.linear.armax_problem import (
    ArmaxOrders,
    Point,
    Problem,
    descend,
    stabilised,
)
from stiction_ros.identification.linear.data import (
    LinearData,
    LinearStatus,
    information,
    nrmse_fit,
)
from stiction_ros.processes import ArxOutput, Noise, NoiseEntry
from stiction_ros.signals.arx import lagged
from stiction_ros.signals.free_run import fitted_free_run
from stiction_ros.signals.polynomials import largest_root


@dataclasses.dataclass(frozen=True)
class ArmaxFit:
    """One output's equation in deviations from the means of the record.

    Attributes:
        name: tag of the output.
        status: ``OK``; ``CONSTRAINED`` where A had to be kept stable; ``NOT_CONVERGED``.
        reason: one sentence; empty when ok.
        orders: n_a, n_b, n_c.
        delays: t_d per valve, samples.
        a: a_1 … a_na, shape (n_a,), sign as in (8a).
        b: shape (m, n_b), engineering units per %.
        c: c_1 … c_nc, shape (n_c,).
        constant: engineering units, for deviations from ``stem0`` and ``pv0``.
        stem0, pv0: operating point, shape (m,) in % and a number in engineering units.
        noise_std: standard deviation of e, engineering units.
        count: samples of the criterion.
        fit_one_step, fit_free_run: NRMSE fit, %; −inf for a free run that diverges.
        aic, bic: of the one-step error, y in units of its standard deviation.
        free_run_aic, free_run_bic: the same of the free-run error.
        residual: e, shape (count,), engineering units, read-only.
    """

    name: str
    status: LinearStatus
    reason: str
    orders: ArmaxOrders
    delays: tuple[int, ...]
    a: FloatArray
    b: FloatArray
    c: FloatArray
    constant: float
    stem0: FloatArray
    pv0: float
    noise_std: float
    count: int
    fit_one_step: float
    fit_free_run: float
    aic: float
    bic: float
    free_run_aic: float
    free_run_bic: float
    residual: FloatArray

    @property
    def theta(self) -> FloatArray:
        """All coefficients as in (11), [a, b of each valve, constant, c]."""
        return np.concatenate([self.a, self.b.ravel(), [self.constant], self.c])

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Roots of A, largest first, shape (n_a,)."""
        poles = np.roots(np.concatenate([[1.0], self.a])).astype(complex)
        return poles[np.argsort(-np.abs(poles), kind="stable")]

    @property
    def gain(self) -> FloatArray:
        """DC gain B_j(1) / A(1), shape (m,), engineering units per %."""
        return np.asarray(self.b.sum(axis=1) / (1.0 + self.a.sum()))

    def equation(self, valves: tuple[str, ...]) -> ArxOutput:
        """Return the equation as an ARX process takes it, in deviations.

        An ARX process knows white noise at two places only: C = 1 is noise in the equation,
        C = A noise added to PV; the nearer of the two is written.
        """
        size = max(len(self.a), len(self.c))
        c, a = (np.pad(v, (0, size - len(v))) for v in (self.c, self.a))
        added = bool(len(self.c)) and np.linalg.norm(c - a) < np.linalg.norm(c)
        entry = NoiseEntry.MEASUREMENT if added else NoiseEntry.EQUATION
        return ArxOutput(
            self.name,
            tuple(map(float, self.a)),
            {v: tuple(map(float, row)) for v, row in zip(valves, self.b, strict=True)},
            dict(zip(valves, self.delays, strict=True)),
            self.constant,
            Noise(self.noise_std, entry),
        )


def fit_armax(
    data: LinearData,
    output: int,
    orders: ArmaxOrders,
    delays: tuple[int, ...],
    first: int | None = None,
) -> ArmaxFit:
    """Fit the equation of one output.

    Args:
        data: inputs (stems, or OP for a valve without friction) and outputs.
        output: index of the output.
        orders: n_a, n_b and n_c; n_c = 0 fits ARX by linear least squares.
        delays: t_d per valve, samples.
        first: first sample of the criterion, one for all rivals of a comparison; None takes
            the least that the orders and delays allow.

    Raises:
        InputError: orders or delays out of range, or a record too short for them.
    """
    reach = check(data, orders, delays)
    first = reach if first is None else first
    parameters = orders.output + len(delays) * orders.input + 1 + orders.noise
    if first < reach:
        raise InputError(f"{first} is before sample {reach}", where="first")
    if data.samples - first < 3 * parameters + 10:
        raise InputError(
            f"{data.samples} samples are too few for {parameters} coefficients",
            where=data.name,
            fix="take a longer record, lower orders or shorter delays",
        )
    y = data.y[output]
    problem = Problem(y, data.u, delays, orders, first)
    point, converged = _search(problem)
    constrained = largest_root(point.a) >= 1.0
    if constrained:
        point, converged = descend(problem, problem.evaluate(point.c, stabilised(point.a)))
    status, reason = LinearStatus.OK, ""
    if not converged:
        status, reason = LinearStatus.NOT_CONVERGED, "the search ended before its tolerance"
    elif constrained:
        status, reason = LinearStatus.CONSTRAINED, "the best equation is unstable; A is held inside"
    return _finish(data, output, problem, point, (orders, delays, status, reason))


def check(data: LinearData, orders: ArmaxOrders, delays: tuple[int, ...]) -> int:
    """Return the first sample that orders and delays reach; raise :class:`InputError`."""
    for key, value, low in (
        ("na", orders.output, 1),
        ("nb", orders.input, 1),
        ("nc", orders.noise, 0),
    ):
        if not low <= value <= 20:
            raise InputError(f"order {value} lies outside {low} to 20", where=key)
    if len(delays) != len(data.valves):
        raise InputError(f"{len(delays)} delays for {len(data.valves)} valves", where="delay")
    if min(delays) < 0:
        raise InputError("a delay is negative", where="delay")
    return max(orders.output, orders.input + max(delays))


def _search(problem: Problem) -> tuple[Point, bool]:
    """Return the best end of three starts: C = 1, C = A (noise on PV) and long-ARX noise."""
    orders = problem.orders
    white = np.zeros(orders.noise + 1)
    white[0] = 1.0
    start = problem.evaluate(white)
    if orders.noise == 0:
        return start, True
    added = white.copy()
    size = min(orders.noise, orders.output) + 1
    added[:size] = stabilised(start.a)[:size]
    starts = [start, problem.evaluate(stabilised(added)), problem.evaluate(_long_arx(problem))]
    ends = [descend(problem, point) for point in starts]
    return min(ends, key=lambda end: end[0].energy)


def _long_arx(problem: Problem) -> FloatArray:
    """Return C by regression on the residuals of a long autoregression of the ARX error."""
    nc = problem.orders.noise
    white = np.zeros(nc + 1)
    white[0] = 1.0
    error = problem.evaluate(white).residual
    lags = min(4 * nc + 4, len(error) // 10)
    columns = np.stack(lagged(error, range(1, lags + 1), lags), axis=1)
    shocks = error[lags:] - columns @ np.linalg.lstsq(columns, error[lags:], rcond=1e-10)[0]
    rows = np.array(lagged(shocks, range(1, nc + 1), nc))
    echo = np.linalg.lstsq(rows.T, error[lags + nc :] - shocks[nc:], rcond=1e-10)[0]
    return stabilised(np.concatenate([[1.0], echo]))


def _finish(
    data: LinearData,
    output: int,
    problem: Problem,
    point: Point,
    made: tuple[ArmaxOrders, tuple[int, ...], LinearStatus, str],
) -> ArmaxFit:
    """Return the equation in engineering units with its scores."""
    orders, delays, status, reason = made
    scale = float(data.y_scale[output])
    y, count = problem.target, len(problem.target)
    drive = np.append(point.b.ravel(), point.constant) @ problem.others
    run = fitted_free_run(point.a[1:], drive, y)
    parameters = orders.output + point.b.size + 1 + orders.noise
    aic, bic = information(point.energy / count, count, parameters)
    with np.errstate(invalid="ignore", over="ignore"):
        missed = float(np.mean((y - run) ** 2))
    free_aic, free_bic = information(missed, count, parameters)
    residual = point.residual * scale
    residual.flags.writeable = False
    return ArmaxFit(
        name=data.outputs[output],
        status=status,
        reason=reason,
        orders=orders,
        delays=delays,
        a=point.a[1:],
        b=point.b * scale / data.u_scale[:, None],
        c=point.c[1:],
        constant=point.constant * scale,
        stem0=data.u_mean,
        pv0=float(data.y_mean[output]),
        noise_std=float(np.sqrt(point.energy / max(count - parameters, 1))) * scale,
        count=count,
        fit_one_step=nrmse_fit(y, y - point.residual),
        fit_free_run=nrmse_fit(y, run),
        aic=aic,
        bic=bic,
        free_run_aic=free_aic,
        free_run_bic=free_bic,
        residual=residual,
    )
