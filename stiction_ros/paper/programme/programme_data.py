"""Scaled data of the nonlinear programme (12), its stems, and the frame of one choice of delays."""

import dataclasses
from typing import Any

import casadi as ca
import numpy as np

from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.paper.smoothed_laws import SmoothLaw, smooth_law
from stiction_ros.signals.arx_fit import ArxOrders, Delays, regressors, stable_arx


def stem_functions(samples: int, law: SmoothLaw) -> tuple[Any, ...]:
    """Return CasADi functions of OP, shape (N,), (f_S, f_D) and τ: the stem, from rest at OP.

    The first gives the stem, shape (N,); the second also its derivatives in f_S and f_D, shape
    (N, 2); the third besides the derivatives of both columns, shape (2N, 2).
    """
    symbols: Any = ca.SX.sym
    state, pair = symbols("s", law.states), symbols("u", 2)
    friction, smoothing = symbols("f", 2), symbols("tau")
    figures = ca.vertcat(friction, smoothing)
    entries, ends, told = (tuple(ca.vertsplit(each)) for each in (state, pair, figures))
    following = ca.vertcat(*law.step(entries, ends, told, ca.tanh))
    sample = ca.Function("sample", [state, pair, figures], [following], {"cse": True})
    op = symbols("op", samples)
    rest = ca.vertcat(op[0], np.zeros(law.states - 1))
    pairs = ca.horzcat(op, ca.vertcat(op[0], op[:-1])).T
    states = sample.mapaccum("states", samples)(rest, pairs, ca.repmat(figures, 1, samples))
    stem = states[0, :].T
    slopes = ca.jacobian(stem, friction)
    found = [stem, slopes, ca.jacobian(slopes, friction)]
    given = [op, friction, smoothing]
    return tuple(ca.Function("stem", given, found[: order + 1]) for order in range(3))


@dataclasses.dataclass(frozen=True)
class ProgrammeData:
    """What all delays share."""

    op: FloatArray  # OP about its mean over its span, shape (m, N)
    pv: FloatArray  # PV about its mean, engineering units, shape (p, N)
    op_span: FloatArray  # shape (m,), %
    limit: FloatArray  # f_max = Δu of every valve, shape (m,), %
    orders: ArxOrders  # n_a, n_b, ε
    law: SmoothLaw  # of the valves
    stems: tuple[Any, ...]  # functions of N samples, by the order of derivatives they go to

    @classmethod
    def of(
        cls, op: FloatArray, pv: FloatArray, limit: FloatArray, orders: ArxOrders, law: str = "he"
    ) -> "ProgrammeData":
        """Scale OP, shape (N, m), and centre PV, shape (N, p)."""
        span, taken = np.ptp(op, axis=0), smooth_law(law)
        scaled, centred = ((op - op.mean(axis=0)) / span).T.copy(), (pv - pv.mean(axis=0)).T.copy()
        return cls(scaled, centred, span, limit, orders, taken, stem_functions(len(op), taken))


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
