"""Compiled: the evidence of stems under a given noise and prior."""

from typing import NamedTuple

import numpy as np

from stiction_ros.compiled import compiled_fused
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.kernels.copies import add_block, put, put_block
from stiction_ros.identification.kernels.lags import (
    Moves,
    grouped,
    lag_products,
    lagged_products,
    moves_of,
    own_products,
    step_products,
    with_past,
)
from stiction_ros.signals.autoregression import whitened

LEAST = 1e-12  # share of the output's energy that is always left


@compiled_fused
def factorised(matrix: FloatArray) -> float:
    """Replace the lower triangle by its Cholesky factor; return the log determinant."""
    size, total = len(matrix), 0.0
    column = np.empty(size)
    for j in range(size):
        pivot = np.sqrt(max(matrix[j, j], 1e-300))
        matrix[j, j] = pivot
        total += np.log(pivot)
        for i in range(j + 1, size):
            column[i] = matrix[i, j] / pivot
            matrix[i, j] = column[i]
        for i in range(j + 1, size):
            by = column[i]
            for k in range(j + 1, i + 1):
                matrix[i, k] -= by * column[k]
    return 2.0 * total


@compiled_fused
def explained_by(factor: FloatArray, right: FloatArray) -> float:
    """Turn the right side into L⁻¹ of it; return what the solution explains of the energy."""
    explained = 0.0
    for i in range(len(right)):
        for k in range(i):
            right[i] -= factor[i, k] * right[k]
        right[i] /= factor[i, i]
        explained += right[i] * right[i]
    return explained


@compiled_fused
def solved(factor: FloatArray, right: FloatArray) -> tuple[FloatArray, float]:
    """Return the solution for a Cholesky factor, and what it explains of the energy."""
    out = right.copy()
    explained = explained_by(factor, out)
    for i in range(len(out) - 1, -1, -1):
        for k in range(i + 1, len(out)):
            out[i] -= factor[k, i] * out[k]
        out[i] /= factor[i, i]
    return out, explained


class Known(NamedTuple):
    """What is known before the record, of several priors."""

    precisions: FloatArray  # inverse of K, shape (K, r, r)
    waves: FloatArray  # 1 / variances of sines and cosines of waves, shape (K, 2 H)
    held: FloatArray  # precisions that a response adds whose sum is held, shape (K, r, r)
    pulls: FloatArray  # that it adds to its products with the output, shape (K, r)
    energies: FloatArray  # that it adds to the output's, shape (K,)
    at: int  # column at which that response begins; below 0 where there is none


@compiled_fused
def beside_prior(
    products: FloatArray, seen: FloatArray, known: Known, k: int
) -> tuple[FloatArray, FloatArray]:
    """Return products, shape (q, q), and those with the output, (q,), with prior ``k`` added."""
    size, lines = known.precisions.shape[1], known.waves.shape[1]
    out, right = products.copy(), seen.copy()
    for w in range(lines):
        out[1 + w, 1 + w] += known.waves[k, w]
    for begin in range(1 + lines, len(out), size):
        add_block(out[begin : begin + size, begin : begin + size], known.precisions[k])
    if known.at >= 0:
        end = known.at + size
        add_block(out[known.at : end, known.at : end], known.held[k])
        for i in range(size):
            right[known.at + i] += known.pulls[k, i]
    return out, right


@compiled_fused
def evidences_of(
    products: FloatArray, seen: FloatArray, energy: float, count: int, known: Known
) -> FloatArray:
    """Return −2 log of the marginal likelihood but for log det K, of several priors, shape (K,).

    Args:
        products: of a constant, waves and lags of stems with each other, shape (q, q).
        seen: of these with the output, shape (q,).
        energy: of the output.
        count: n, rows.
        known: the priors.
    """
    out = np.empty(len(known.precisions))
    for k in range(len(out)):
        factor, right = beside_prior(products, seen, known, k)
        determinant = factorised(factor)
        explained = explained_by(factor, right)
        left = max(energy + known.energies[k] - explained, LEAST * energy)
        out[k] = count * np.log(left / count) + determinant
    return out


class Lines(NamedTuple):
    """A constant, and sines and cosines, over the rows that count."""

    rows: FloatArray  # the constant, all sines, and all cosines, shape (1 + 2 H, n)
    before: FloatArray  # their values one row earlier, shape (1 + 2 H,)
    turns: FloatArray  # of each sine and its cosine, rad a row, shape (H,)
    gram: FloatArray  # products of the rows with each other, shape (1 + 2 H, 1 + 2 H)


@compiled_fused
def beside_lines(past: FloatArray, lines: Lines, edges: IntArray) -> FloatArray:
    """Return the products of the groups of lags of a signal with lines, shape (r, 1 + 2 H).

    A lag later, a line stands to the signal as it did, turned: only the rows at both ends differ.

    Args:
        past: the last M + n + 1 samples, those before the record included.
        lines: a constant, sines and cosines.
        edges: of the groups, as in :func:`...kernels.lags.grouped`.
    """
    taps, count, lasting = edges[-1], lines.rows.shape[1], len(lines.turns)
    begun = np.dot(lines.rows, past[taps : taps + count])
    out = np.empty((len(edges) - 1, len(begun)))
    lags, others = np.empty(taps), np.empty(taps)
    level, by = begun[0], lines.before[0]
    for i in range(taps):
        lags[i] = level
        level += by * (past[taps - 1 - i] - past[taps - 1 - i + count])
    put(out[:, 0], grouped(lags, edges))
    for h in range(1, lasting + 1):
        sine, cosine = begun[h], begun[lasting + h]
        enters = lines.before[h], lines.before[lasting + h]
        leaves = lines.rows[h, count - 1], lines.rows[lasting + h, count - 1]
        along, across = np.cos(lines.turns[h - 1]), np.sin(lines.turns[h - 1])
        for i in range(taps):
            lags[i], others[i] = sine, cosine
            new, old = past[taps - 1 - i], past[taps - 1 - i + count]
            sine += enters[0] * new - leaves[0] * old
            cosine += enters[1] * new - leaves[1] * old
            sine, cosine = along * sine + across * cosine, along * cosine - across * sine
        put(out[:, h], grouped(lags, edges))
        put(out[:, lasting + h], grouped(others, edges))
    return out


class Given(NamedTuple):
    """What stands beside one stem in one output, whitened."""

    noise: FloatArray  # monic polynomial D, shape (d + 1,)
    judged: int  # n, rows that count
    lines: Lines  # a constant and waves from outside
    others: FloatArray  # stems of the other valves, scaled, shape (m − 1, N)
    beside: FloatArray  # their last M + n + 1 samples, whitened, shape (m − 1, M + n + 1)
    others_first: FloatArray  # ``step_products`` with their first lag, shape (m − 1, N + M)
    # L^-1, with L L^T the products of the lines and of the lags of each of ``others`` with each
    # other and what is known of them before the record, shape (q, q)
    root: FloatArray
    target: FloatArray  # ``step_products`` with what all these leave of the output, shape (N + M,)
    pull: FloatArray  # that a held response adds to its products with the target, shape (r,)
    energy: float  # of that and of the prior of what explains the rest
    edges: IntArray  # of the groups of lags, shape (r + 1,)
    precision: FloatArray  # inverse of K, shape (r, r)
    constant: float  # log det K, and what all these add to the loss


@compiled_fused
def _evidence(stem: FloatArray, moves: Moves, given: Given) -> float:
    r"""Return −2 log of the marginal likelihood but for constants.

    .. math:: n \log(r / n) + \log\det(X X^T + K^{-1})

    with r what the response of the best fit and its prior leave of the target, and X the whitened
    lags of the stem, scaled, shape (N,), but for what stands beside them explains.
    """
    size, known, edges = len(given.precision), len(given.lines.rows), given.edges
    taps, count = edges[-1], given.judged
    signal = with_past(whitened(given.noise, stem, stem[0]), taps)[-(taps + count + 1) :]
    first = step_products(given.noise, signal[-1 - count : -1], len(stem), taps)
    gram = own_products(signal, lag_products(moves, first, taps), edges)
    shared = np.empty((size, len(given.root)))
    put_block(shared[:, :known], beside_lines(signal, given.lines, edges))
    for other in range(len(given.others)):
        at, theirs = known + other * size, moves_of(given.others[other])
        begun = (
            lag_products(moves, given.others_first[other], taps),
            lag_products(theirs, first, taps),
        )
        beside = given.beside[other]
        put_block(shared[:, at : at + size], lagged_products(signal, beside, begun, edges))
    shared = np.dot(shared, given.root.T)
    gram -= np.dot(shared, shared.T)
    gram += given.precision
    determinant = factorised(gram)
    seen = grouped(lag_products(moves, given.target, taps), edges) + given.pull
    left = max(given.energy - explained_by(gram, seen), LEAST * given.energy)
    return float(count * np.log(left / count) + determinant)


@compiled_fused
def losses_of(stems: FloatArray, given: Given, least_moves: int) -> FloatArray:
    """Return the loss of many stems, shape (G, N); infinite where one moves in fewer rows."""
    out = np.full(len(stems), np.inf)
    for g in range(len(stems)):
        moves = moves_of(stems[g])
        if len(moves.at) >= least_moves:
            out[g] = _evidence(stems[g], moves, given) + given.constant
    return out
