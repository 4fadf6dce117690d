"""How well every point of a grid explains a gap, under given noise."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.discrepancy.candidate.base import Candidate, Response
from stiction_ros.discrepancy.likelihood.least_squares import left_by, whitened_block
from stiction_ros.discrepancy.measures import EPSILON, PROBE, ROUNDING
from stiction_ros.effects.behaviour import BoolArray, FloatArray, IntArray
from stiction_ros.signals.autoregression import TINY, whiten

if TYPE_CHECKING:
    from stiction_ros.discrepancy.fit.baseline import Baseline


@compiled
def left_of_shifts(
    target: FloatArray, shift: FloatArray, rows: IntArray, basis: FloatArray, ar: FloatArray
) -> FloatArray:
    """Return the squared innovations that each response leaves, shape (G,).

    Args:
        target: whitened gap without the shared columns, shape (n,).
        shift: responses, shape (N, G).
        rows: of ``target`` among the N, rising.
        basis: orthonormal, of the whitened shared columns, shape (n, r).
        ar: φ, shape (p,).
    """
    size, rank = shift.shape[1], basis.shape[1]
    squares, inside = np.zeros(size), np.zeros((rank, size))
    white = np.empty(size)
    for n in range(len(rows)):
        k, wanted = rows[n], target[n]
        for g in range(size):
            white[g] = wanted - shift[k, g]
        for i in range(min(len(ar), k)):
            factor = ar[i]
            for g in range(size):
                white[g] += factor * shift[k - 1 - i, g]
        for g in range(size):
            squares[g] += white[g] * white[g]
        for c in range(rank):
            weight = basis[n, c]
            for g in range(size):
                inside[c, g] += weight * white[g]
    for c in range(rank):
        for g in range(size):
            squares[g] -= inside[c, g] * inside[c, g]
    return squares


def taken_by_sizes(
    target: FloatArray, sizes: FloatArray, rows: BoolArray, basis: FloatArray, ar: FloatArray
) -> FloatArray:
    """Return the squares that least squares of the factors takes away, shape (G,).

    Args:
        target, basis, ar: as for :func:`left_of_shifts`; the shared columns are not in ``target``.
        sizes: columns of the factors, shape (N, G, s).
        rows: which of the N are those of ``target``, shape (N,).
    """
    points, factors = sizes.shape[1:]
    columns = np.ascontiguousarray(sizes.reshape(len(sizes), -1).T)
    white = whitened_block(columns, ar, rows, 0.0).reshape(points, factors, -1)
    inside, cross = white @ basis, white @ target
    whole = white @ white.transpose(0, 2, 1)
    gram = whole - inside @ inside.transpose(0, 2, 1)
    ridge = ROUNDING * np.trace(gram, axis1=1, axis2=2) + len(target) * EPSILON * np.trace(
        whole, axis1=1, axis2=2
    )
    gram += (ridge + TINY)[:, None, None] * np.eye(sizes.shape[2])
    factors = np.linalg.solve(gram, cross[:, :, None])[:, :, 0]
    return np.asarray(np.sum(factors * cross, axis=1))


def misfit(
    base: "Baseline", gap: FloatArray, response: Response, ar: Mapping[int, FloatArray]
) -> FloatArray:
    """Return Σ n log(sum of squared innovations) for every point of a grid under given φ.

    Infinite where the response is that of figures which the effect cannot have.
    """
    total: FloatArray | float = 0.0
    for i in response.outputs:
        marked = base.blocks[i].train
        basis = base.basis(i, ar[i])
        rows = np.flatnonzero(marked)
        target = left_by(basis, whiten(gap[:, i], ar[i])[marked])
        shift, sizes = response.shifts.get(i), response.sizes.get(i)
        if shift is not None:
            squares = left_of_shifts(target, np.ascontiguousarray(shift), rows, basis, ar[i])
        else:
            assert sizes is not None
            squares = target @ target - taken_by_sizes(target, sizes, marked, basis, ar[i])
        count = base.blocks[i].measured * len(rows)
        total = total + count * np.log(np.maximum(squares, TINY))
    if response.possible is not None:
        total = np.where(response.possible, total, np.inf)
    return np.asarray(total)


def settled(
    base: "Baseline",
    gap: FloatArray,
    candidate: Candidate,
    coordinates: FloatArray,
    ar: Mapping[int, FloatArray],
) -> tuple[FloatArray, Response]:
    """Return points with their linear figures at their best under given φ, and their response.

    Each figure has a normal prior round 0, with the range of the figure as standard deviation. So a
    figure stays near 0 where the rows say nothing about it.
    """
    moved, response = coordinates.copy(), None

    def respond(value: float) -> Response:
        moved[:, d] = value
        return candidate.respond(base.run, candidate.values(moved))

    for d, axis in enumerate(candidate.axes):
        if not axis.linear:
            continue
        middle, more = respond(0.0), respond(PROBE * axis.high)
        sides = [middle.towards(more, np.array([-1.0])), middle, more]
        scores = np.array([misfit(base, gap, side, ar) for side in sides])
        rows = sum(base.noise[i].rows for i in middle.outputs)
        low, level, high = np.exp((scores - np.min(scores, axis=0)) / max(rows, 1))
        bend = np.maximum(low - 2.0 * level + high, 0.0) + 2.0 * PROBE**2 / max(rows, 1)
        vertex = np.clip(0.5 * PROBE * (low - high), -bend, bend) / bend
        moved[:, d] = vertex * axis.high
        response = middle.towards(more, vertex / PROBE)
    return moved, response or candidate.respond(base.run, candidate.values(moved))
