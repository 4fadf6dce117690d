"""Scaled data of the nonlinear programme (12), its stems, and the frame of one choice of delays."""

import dataclasses
from typing import Any

import casadi as ca
import numpy as np

from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.paper.smoothed_laws import SmoothLaw, smooth_law
from stiction_ros.signals.arx_fit import ArxFit, ArxOrders, Delays, regressors, stable_arx

BLOCK = 250
SECOND = ((0, 0), (0, 1), (1, 1))


def _step(law: SmoothLaw, order: int) -> Any:
    """Return one sample: (s and its derivatives, u, [f_S, f_D, τ]) → the same one later.

    u is (u_k, u_{k−1}). With q entries of s, the first q of what is returned are s, the next 2q
    ∂s/∂f_S and ∂s/∂f_D, the last 3q the second derivatives in the order of ``SECOND``.
    """
    q = law.states
    symbols: Any = ca.SX.sym
    start, op, smoothing = symbols("s", q), symbols("u", 2), symbols("tau")
    friction = symbols("f", 2)
    following: Any = ca.vertcat(
        *law.step(
            ca.vertsplit(start), (op[0], op[1]), (friction[0], friction[1], smoothing), ca.tanh
        )
    )
    inputs = ca.vertcat(start, friction)
    state: list[Any] = [start]
    new: list[Any] = [following]
    if order >= 1:
        slope: Any = ca.jacobian(following, inputs)
        first = symbols("s_f", q, 2)
        carried: Any = ca.vertcat(first, ca.SX.eye(2))
        state.append(ca.vec(first))
        new.append(ca.vec(ca.mtimes(slope, carried)))
    if order == 2:
        bends = [ca.hessian(following[i], inputs)[0] for i in range(q)]
        second = symbols("s_ff", q, 3)
        state.append(ca.vec(second))
        for k, (one, two) in enumerate(SECOND):
            bent = [ca.mtimes([carried[:, one].T, bend, carried[:, two]]) for bend in bends]
            new.append(ca.vertcat(*bent) + ca.mtimes(slope[:, :q], second[:, k]))
    arguments = [ca.vertcat(*state), op, ca.vertcat(friction, smoothing)]
    return ca.Function("step", arguments, [ca.vertcat(*new)], {"cse": True})


def _block(step: Any, length: int) -> Any:
    """Return ``length`` samples in one function: (state, u, parameters) → all states."""
    start = ca.SX.sym("start", step.size1_in(0))
    values, parameters = ca.SX.sym("u", 2, length), ca.SX.sym("p", 3)
    state, passed = start, []
    for k in range(length):
        state = step(state, values[:, k], parameters)
        passed.append(state)
    return ca.Function("block", [start, values, parameters], [ca.horzcat(*passed)])


class StemSensitivities:
    r"""CasADi expressions of the stem for a given OP, with derivatives in f = (f_S, f_D).

    One sample is s_k = F(s_{k−1}, u_k, u_{k−1}, f), where the first entry of s is the stem χ; for
    the law (5)-(6) it is the only one. Then

    .. math::
        \partial_p \chi_k &= F_\chi \, \partial_p \chi_{k-1} + F_p \\
        \partial_{pq} \chi_k &= F_{\chi\chi} \, \partial_p \chi_{k-1} \partial_q \chi_{k-1}
            + F_{\chi p} \, \partial_q \chi_{k-1} + F_{\chi q} \, \partial_p \chi_{k-1} + F_{pq}
            + F_\chi \, \partial_{pq} \chi_{k-1}

    Attributes:
        law: of the valves.
    """

    def __init__(self, samples: int, law: SmoothLaw) -> None:
        """Prepare for OPs of N ``samples``."""
        self.law = law
        self._blocks = []
        for order in range(3):
            step = _step(self.law, order)
            whole, rest = divmod(samples, BLOCK)
            lengths = [BLOCK] * whole + ([rest] if rest else [])
            made = {length: _block(step, length) for length in set(lengths)}
            self._blocks.append([made[length] for length in lengths])

    def expression(self, order: int, op: FloatArray, parameters: Any) -> list[Any]:
        """Return χ and its derivatives up to ``order`` as rows of shape (1, N).

        They are ∂χ/∂f_S, ∂χ/∂f_D; then the second derivatives as in ``SECOND``. The stem before
        the first sample is the first OP, shape (N,); ``parameters`` are f_S, f_D, τ, shape (3, 1).
        """
        blocks = self._blocks[order]
        state = np.zeros(blocks[0].size1_in(0))
        state[0] = op[0]
        values = np.vstack([op, np.append(op[0], op[:-1])])
        at, current, passed = 0, ca.MX(ca.DM(state)), []
        for block in blocks:
            length = block.size2_in(1)
            part = block(current, ca.DM(values[:, at : at + length]), parameters)
            current, at = part[:, length - 1], at + length
            passed.append(part)
        rows = ca.horzcat(*passed)
        return list(ca.vertsplit(rows))[:: self.law.states]


@dataclasses.dataclass(frozen=True)
class ProgrammeData:
    """What all delays share."""

    op: FloatArray  # OP about its mean over its span, shape (m, N)
    pv: FloatArray  # PV about its mean, engineering units, shape (p, N)
    op_mean: FloatArray  # op_mean, op_span: shape (m,), %
    op_span: FloatArray
    pv_mean: FloatArray  # shape (p,)
    limit: FloatArray  # f_max = Δu of every valve, shape (m,), %
    orders: ArxOrders  # n_a, n_b, ε
    stems: StemSensitivities  # sensitivities for N samples

    @classmethod
    def of(
        cls, op: FloatArray, pv: FloatArray, limit: FloatArray, orders: ArxOrders, law: str = "he"
    ) -> "ProgrammeData":
        """Scale OP, shape (N, m), and centre PV, shape (N, p)."""
        mean, span, level = op.mean(axis=0), np.ptp(op, axis=0), pv.mean(axis=0)
        scaled, centred = ((op - mean) / span).T.copy(), (pv - level).T.copy()
        stems = StemSensitivities(len(op), smooth_law(law))
        return cls(scaled, centred, mean, span, level, limit, orders, stems)


@dataclasses.dataclass(frozen=True)
class Frame:
    """Start and scaling of the ARX part for one choice of delays.

    The unknowns are f_S and f_D of every valve over the span of OP, then for every output z
    with θ = θ_0 + T z, where θ_0 is the ARX start (15) and T whitens its regressors. Coefficients
    beyond the orders of their channel are 0 in θ_0 and T, and their entries of z are held.
    """

    data: ProgrammeData  # what all delays share
    delays: Delays  # for each output the t_d of each valve, samples
    theta: tuple[FloatArray, ...]  # θ_0 per output, (a, b, c), shape (n_a + m n_b + 1,)
    basis: tuple[FloatArray, ...]  # T per output
    past: tuple[FloatArray, ...]  # columns −y_{k−1} … −y_{k−n_a} per output, shape (N − ε, n_a)
    start_error: float  # (12a) at θ_0 with χ = u, squared engineering units

    @classmethod
    def of(cls, data: ProgrammeData, delays: Delays) -> "Frame":
        """Compute the ARX start (15)-(16) between OP and PV, made stable, and its whitening."""
        orders = data.orders
        masks = [orders.kept(i, len(data.op)) for i in range(len(data.pv))]
        fits = [
            stable_arx(y, data.op, row, orders, kept)
            for y, row, kept in zip(data.pv, delays, masks, strict=True)
        ]
        error = float(np.mean([fit.squared_error for fit in fits]))
        past, basis = [], []
        for y, row, kept in zip(data.pv, delays, masks, strict=True):
            phi = regressors(y, data.op, row, orders)
            free = np.flatnonzero(np.append(kept, True))
            whole = np.column_stack([phi, np.ones(len(phi))])[:, free]
            norm = np.linalg.norm(whole, axis=0) + 1e-300
            factor = np.linalg.qr(whole / norm, mode="r")
            signs = np.where(np.diag(factor) < 0.0, -1.0, 1.0)
            factor = factor + 1e-10 * np.diag(signs)
            inverse = np.linalg.solve(factor, np.eye(len(factor)))
            past.append(phi[:, : orders.output])
            whitened = np.zeros((len(kept) + 1, len(kept) + 1))
            whitened[np.ix_(free, free)] = inverse / norm[:, None] * np.sqrt(error)
            basis.append(whitened)
        theta = tuple(np.concatenate([fit.a, fit.b.ravel(), [fit.constant]]) for fit in fits)
        return cls(data, delays, theta, tuple(basis), tuple(past), error)

    @property
    def valves(self) -> int:
        """Number of valves m."""
        return len(self.data.op)

    @property
    def outputs(self) -> int:
        """Number of outputs p."""
        return len(self.data.pv)

    @property
    def width(self) -> int:
        """Unknowns of one output, n_a + m n_b + 1."""
        return self.data.orders.output + self.valves * self.data.orders.input + 1

    @property
    def held(self) -> BoolArray:
        """Which unknowns have no effect, as their coefficients are none, shape (size,)."""
        parts = [np.zeros(2 * self.valves, bool)]
        for i in range(self.outputs):
            parts += [~self.data.orders.kept(i, self.valves), np.zeros(1, bool)]
        return np.concatenate(parts)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return 2 * self.valves + self.outputs * self.width

    def models(self, x: FloatArray) -> tuple[ArxFit, ...]:
        """Return the ARX models of unknowns ``x`` in engineering units, SE left at NaN."""
        data, orders, made = self.data, self.data.orders, []
        for i, row in enumerate(self.delays):
            place = 2 * self.valves + i * self.width
            theta = self.theta[i] + self.basis[i] @ x[place : place + self.width]
            a = theta[: orders.output]
            b = theta[orders.output : -1].reshape(self.valves, orders.input)
            b = b / data.op_span[:, None]
            constant = float(theta[-1] + data.pv_mean[i] * (1.0 + a.sum()))
            constant -= float(b.sum(axis=1) @ data.op_mean)
            made.append(ArxFit(row, a, b, constant, float("nan"), np.empty(0)))
        return tuple(made)
