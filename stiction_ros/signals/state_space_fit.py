r"""Matrices of an innovation model from its states, and the errors of such a model.

.. math::
    \xi_{k+1} &= A \xi_k + B \chi_k + K e_k \\
    y_k &= C \xi_k + y_0 + e_k

With A, C and K given, the error is linear in B, ξ_0 and y_0: driven by χ alone it is the
free-run error, driven by χ and y through A − K C the one-step error.
"""

import dataclasses

import numpy as np
from scipy.linalg import solve_discrete_are

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals.state_space import responses
from stiction_ros.signals.subspace_projection import StateSequence

TINY = 1e-24  # variance, in that of the outputs, below which an error counts as none


@dataclasses.dataclass(frozen=True)
class Realisation:
    """An innovation model of centred, scaled data."""

    a: FloatArray  # a, b, c, k: shapes (n, n), (n, m), (p, n), (n, p)
    b: FloatArray
    c: FloatArray
    k: FloatArray
    x0: FloatArray  # ξ of the first sample, shape (n,)
    y0: FloatArray  # offset, shape (p,)

    @property
    def radius(self) -> float:
        """Largest pole, |λ|."""
        return spectral_radius(self.a)


def spectral_radius(matrix: FloatArray) -> float:
    """Return the largest absolute eigenvalue; 0 for an empty matrix."""
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))


def realise(sequence: StateSequence, order: int, u: FloatArray, y: FloatArray) -> Realisation:
    """Return the matrices of the first ``order`` states by two regressions.

    C and the innovations from y on ξ, then A, B and K from ξ one sample later on ξ, χ and the
    innovations; a constant stands in both. :func:`with_best_gain` may change K afterwards.
    """
    s, n = sequence.horizon, order
    states = sequence.states[:n]
    now, later = states[:, :-1], states[:, 1:]
    ones = np.ones((1, now.shape[1]))
    output, residual = _regress(y[:, s:], np.vstack([now, ones]))
    dynamics, _ = _regress(later, np.vstack([now, ones, u[:, s:], residual]))
    a, b, k = dynamics[:, :n], dynamics[:, n + 1 : n + 1 + len(u)], dynamics[:, n + 1 + len(u) :]
    # The constant of the state equation moves into the offset.
    rest = np.linalg.lstsq(np.eye(n) - a, dynamics[:, n], rcond=None)[0]
    c = output[:, :n]
    return Realisation(a, b, c, k, np.zeros(n), output[:, n] + c @ rest)


def with_best_gain(
    model: Realisation, sequence: StateSequence, u: FloatArray, y: FloatArray
) -> Realisation:
    """Return ``model`` with the K of the smallest one-step error.

    Tried are its own K, the stationary Kalman gain of the covariances that the states leave in
    both equations, and K = 0, for which the one-step error is the free-run error.
    """
    s, n = sequence.horizon, len(model.a)
    states = sequence.states[:n]
    v = y[:, s:] - model.c @ states[:, :-1]
    w = states[:, 1:] - model.a @ states[:, :-1] - model.b @ u[:, s:]
    v, w = v - v.mean(axis=1, keepdims=True), w - w.mean(axis=1, keepdims=True)
    gains = [model.k, _kalman_gain(model.a, model.c, w, v), np.zeros_like(model.k)]
    rivals = [dataclasses.replace(model, k=k) for k in gains]

    def loss(rival: Realisation) -> float:
        if spectral_radius(rival.a - rival.k @ rival.c) >= 1.0:
            return float("inf")
        error = (y - predict(rival, u, y, one_step=True))[:, s:]
        return float(np.linalg.slogdet(error @ error.T / error.shape[1] + TINY * np.eye(len(y)))[1])

    return min(rivals, key=loss)


def _regress(target: FloatArray, regressors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return coefficients and residual of ``target`` on the rows of ``regressors``."""
    coefficients = np.asarray(np.linalg.lstsq(regressors.T, target.T, rcond=1e-9)[0].T, float)
    return coefficients, target - coefficients @ regressors


def _kalman_gain(a: FloatArray, c: FloatArray, w: FloatArray, v: FloatArray) -> FloatArray:
    """Return K from the residuals of state and output equation; zero where none exists."""
    count = w.shape[1]
    q, r, s = w @ w.T / count, v @ v.T / count, w @ v.T / count
    try:
        p = solve_discrete_are(a.T, c.T, q, r, s=s)
        return np.asarray(np.linalg.solve(c @ p @ c.T + r, (a @ p @ c.T + s).T).T)
    except ValueError:  # LinAlgError is one
        return np.zeros((len(a), len(c)))


def refine(model: Realisation, u: FloatArray, y: FloatArray, one_step: bool) -> Realisation:
    """Return ``model`` with B, ξ_0 and y_0 that minimise the sum of squares of one error.

    The free-run error is right in open loop; where a controller feeds noise back, only the
    one-step error is. The model comes back unchanged where the error diverges.
    """
    k = model.k if one_step else np.zeros_like(model.k)
    transition = model.a - k @ model.c
    if spectral_radius(transition) >= 1.0:
        return model
    (n, m), (p, samples) = model.b.shape, y.shape
    # Columns of B, of y_0, of ξ_0, and what is known.
    drives, start = np.zeros((samples, n, m * n + p + n + 1)), np.zeros((n, m * n + p + n + 1))
    for j in range(m):
        drives[:, :, j * n : (j + 1) * n] = u[j][:, None, None] * np.eye(n)
    drives[:, :, m * n : m * n + p], start[:, m * n + p : -1] = -k, np.eye(n)
    drives[:, :, -1] = (k @ y).T
    forced = responses(transition, model.c, drives, start)
    forced[:, :, m * n : m * n + p] += np.eye(p)
    target, columns = y.T - forced[:, :, -1], forced[:, :, :-1].reshape(samples * p, -1)
    solution = np.asarray(np.linalg.lstsq(columns, target.ravel(), rcond=1e-10)[0], dtype=float)
    return dataclasses.replace(
        model,
        b=solution[: m * n].reshape(m, n).T,
        y0=solution[m * n : m * n + p],
        x0=solution[m * n + p :],
    )


def predict(model: Realisation, u: FloatArray, y: FloatArray, one_step: bool) -> FloatArray:
    """Return ŷ, shape (p, N): in free run, or one step ahead with the gain K."""
    transition = model.a - model.k @ model.c if one_step else model.a
    drive = model.b @ u
    if one_step:
        drive = drive + model.k @ (y - model.y0[:, None])
    with np.errstate(over="ignore", invalid="ignore"):
        run = responses(transition, model.c, drive.T[:, :, None], model.x0[:, None])
    return run[:, :, 0].T + model.y0[:, None]
