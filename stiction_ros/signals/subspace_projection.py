r"""States of a linear system from past and future data: Hankel matrices, LQ, SVD.

With the past :math:`W_p` (inputs and outputs of the last s samples) and the future inputs
:math:`U_f`, the future outputs of (2) are

.. math:: Y_f = \Gamma X + H U_f + G E_f, \qquad X = L W_p

so the part of :math:`Y_f` that :math:`W_p` explains beside :math:`U_f` (the oblique
projection) has the column space of :math:`\Gamma` and the row space of the states.
"""

import dataclasses
import enum

import numpy as np
from scipy.linalg import qr

from stiction_ros.effects.behaviour import FloatArray

RANK = 1e-10  # singular values below this share of the largest count as zero


class SubspaceMethod(enum.StrEnum):
    """Which projection gives the states.

    ``N4SID`` and ``CVA`` weight one oblique projection differently. They want inputs that do not
    depend on past noise, as in an open-loop experiment. ``PREDICTOR`` takes the projection from a
    long ARX predictor; it needs no future inputs and stays consistent in closed loop.
    """

    N4SID = "n4sid"
    CVA = "cva"
    PREDICTOR = "predictor"


@dataclasses.dataclass(frozen=True)
class StateSequence:
    """States up to similarity, ordered by weight."""

    states: FloatArray  # shape (n_max, N − s + 1); column 0 belongs to sample s
    singular_values: FloatArray  # all of the weighted projection, falling
    horizon: int  # s


def hankel_rows(signals: FloatArray, first: int, count: int, columns: int) -> FloatArray:
    """Return ``count`` block rows, oldest first; block i holds samples first + i ….

    Args:
        signals: shape (q, N).

    Returns:
        Shape (count · q, columns).
    """
    return np.vstack([signals[:, first + i : first + i + columns] for i in range(count)])


def state_sequence(
    u: FloatArray, y: FloatArray, horizon: int, max_order: int, method: SubspaceMethod
) -> StateSequence:
    """Return the states of a record.

    Args:
        u: inputs, shape (m, N).
        y: outputs, shape (p, N).
        horizon: s, block rows of past and future; N must exceed 2s (m + p + 1).
        max_order: most states returned.
        method: see :class:`SubspaceMethod`.
    """
    if method is SubspaceMethod.PREDICTOR:
        mapping, left, values = _predictor(u, y, horizon)
        weight = np.eye(len(mapping))
    else:
        mapping, left, values, weight = _oblique(u, y, horizon, method)
    rank = int(np.count_nonzero(values > RANK * values[0]))
    n = min(max_order, rank)
    root = np.sqrt(values[:n])
    to_state = (left[:, :n].T @ weight @ mapping) / root[:, None]
    past = hankel_rows(np.vstack([u, y]), 0, horizon, u.shape[1] - horizon + 1)
    return StateSequence(to_state @ past, values, horizon)


def _lower(blocks: list[FloatArray]) -> FloatArray:
    """Return the factor L of the LQ factorisation of the stacked blocks."""
    stacked = np.vstack(blocks)
    return np.asarray(qr(stacked.T, mode="r", overwrite_a=True)[0][: len(stacked)].T)


def _oblique(
    u: FloatArray, y: FloatArray, s: int, method: SubspaceMethod
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return (G, U, singular values, W₁) with the projection G W_p.

    A row of ones stands beside the future inputs, so that a constant disturbs nothing.
    """
    columns = u.shape[1] - 2 * s + 1
    future_inputs = np.vstack([np.ones(columns), hankel_rows(u, s, s, columns)])
    past = hankel_rows(np.vstack([u, y]), 0, s, columns)
    future = hankel_rows(y, s, s, columns)
    lower = _lower([future_inputs, past, future])
    i, j = len(future_inputs), len(future_inputs) + len(past)
    l21, l22 = lower[i:j, :i], lower[i:j, i:j]
    l32, l33 = lower[j:, i:j], lower[j:, j:]
    mapping = l32 @ np.linalg.pinv(l22, rcond=RANK)
    weight, body = np.eye(len(future)), mapping @ np.hstack([l21, l22])
    if method is SubspaceMethod.CVA:
        # The symmetric inverse square root of F Fᵀ on its range, for F = (l32, l33).
        left, values, _ = np.linalg.svd(np.hstack([l32, l33]), full_matrices=False)
        keep = values > RANK * values[0]
        weight = (left[:, keep] / values[keep]) @ left[:, keep].T
        body = weight @ l32
    left, values, _ = np.linalg.svd(body, full_matrices=False)
    return mapping, left, values, weight


def _predictor(u: FloatArray, y: FloatArray, s: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (Γ L, U, singular values) from the ARX predictor of order s."""
    p, q = len(y), len(u) + len(y)
    columns = u.shape[1] - s
    past = hankel_rows(np.vstack([u, y]), 0, s, columns)
    lower = _lower([np.ones((1, columns)), past, y[:, s:]])
    l22, l32 = lower[1 : 1 + s * q, 1 : 1 + s * q], lower[1 + s * q :, 1 : 1 + s * q]
    markov = l32 @ np.linalg.pinv(l22, rcond=RANK)
    # Block row j predicts j samples further on: every past sample is j lags older.
    mapping = np.zeros((s * p, s * q))
    for j in range(s):
        mapping[j * p : (j + 1) * p, j * q :] = markov[:, : (s - j) * q]
    left, values, _ = np.linalg.svd(mapping @ l22, full_matrices=False)
    return mapping, left, values
