"""Signals through 1/A and D and their differences as rows of a matrix, compiled."""

import numpy as np

from stiction_ros.compiled import compiled, compiled_fused
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.kernels.copies import put

DEPENDENT = 1e-6  # pivot of a scaled column, as a root, below which it depends on the others
EMPTY = 1e-12


@compiled_fused
def _driven_pair(
    a: FloatArray, x: FloatArray, z: FloatArray, first: FloatArray, second: FloatArray
) -> None:
    """Write x / A and z / A side by side, as each waits for its last values."""
    order = len(a) - 1
    a1, a2, a3 = 0.0, 0.0, 0.0
    if order > 0:
        a1 = a[1]
    if order > 1:
        a2 = a[2]
    if order > 2:
        a3 = a[3]
    p0 = p1 = q0 = q1 = r0 = r1 = 0.0  # one, two and three samples before stay in registers
    for k in range(len(x)):
        y0, y1 = x[k], z[k]
        for i in range(min(order, k), 3, -1):
            y0 -= a[i] * first[k - i]
            y1 -= a[i] * second[k - i]
        y0 = (y0 - a3 * r0 - a2 * q0) - a1 * p0
        y1 = (y1 - a3 * r1 - a2 * q1) - a1 * p1
        first[k], second[k] = y0, y1
        r0, q0, p0 = q0, p0, y0
        r1, q1, p1 = q1, p1, y1


@compiled
def driven_rows(a: FloatArray, signals: FloatArray, begin: int, end: int, out: FloatArray) -> None:
    """Write rows ``begin`` to ``end`` of the signals through 1/A, from rest."""
    for row in range(begin, end, 2):
        other = min(row + 1, end - 1)
        _driven_pair(a, signals[row], signals[other], out[row], out[other])


@compiled_fused
def averaged(d: FloatArray, x: FloatArray, start: int, length: int, out: FloatArray) -> None:
    """Write D x at ``length`` samples from ``start`` on; x begins n_d samples before or earlier."""
    for k in range(length):
        out[k] = 0.0
    for i in range(0, len(d), 3):
        two, three = min(i + 1, len(d) - 1), min(i + 2, len(d) - 1)
        d0, d1, d2 = d[i], d[two] if two > i else 0.0, d[three] if three > two else 0.0
        x0, x1, x2 = x[start - i :], x[start - two :], x[start - three :]
        for k in range(length):
            out[k] += d0 * x0[k] + d1 * x1[k] + d2 * x2[k]


@compiled
def through(
    rows: FloatArray, numerator: FloatArray, denominator: FloatArray, count: int
) -> FloatArray:
    """Return rows, followed by zeros, through D/A from rest, shape (q, N)."""
    order, padded = len(numerator) - 1, np.zeros(len(numerator) - 1 + count)
    moved, out = np.empty((len(rows), count)), np.empty((len(rows), count))
    for i in range(len(rows)):
        put(padded[order:], rows[i])
        averaged(numerator, padded, order, count, moved[i])
    driven_rows(denominator, moved, 0, len(rows), out)
    return out


@compiled_fused
def differences(
    table: FloatArray, x: FloatArray, start: int, length: int, rows: FloatArray, row: int
) -> None:
    """Write x from ``start`` on and its first differences, as many as ``table`` has rows.

    Args:
        table: of the differences; x begins as many samples before as there are, or earlier.
    """
    now = rows[row]
    part = x[start:]
    for k in range(length):
        now[k] = part[k]
    for i in range(1, len(table)):
        before, now = now, rows[row + i]
        value = 0.0
        for j in range(i + 1):
            value += table[i, j] * x[start - j]
        now[0] = value
        earlier, later = before[0:], before[1:]
        part = now[1:]
        for k in range(length - 1):
            part[k] = later[k] - earlier[k]


@compiled
def factor(gram: FloatArray, size: int) -> tuple[FloatArray, IntArray, int]:
    """Return a Cholesky factor for the first ``size`` rows of a Gram matrix.

    Returns:
        The factor of the rows that are kept, as those that depend on others before them are left
        out, in the upper left; the indices of the rows; how many there are.
    """
    root, kept = np.empty((size, size)), np.empty(size, dtype=np.int64)
    largest, number = 0.0, 0
    for i in range(size):
        largest = max(largest, gram[i, i])
    for i in range(size):
        if not gram[i, i] > EMPTY * EMPTY * largest:
            continue
        rest = gram[i, i]
        for j in range(number):
            value = gram[i, kept[j]]
            for before in range(j):
                value -= root[number, before] * root[j, before]
            value /= root[j, j]
            root[number, j] = value
            rest -= value * value
        if rest > DEPENDENT * DEPENDENT * gram[i, i]:
            root[number, number] = np.sqrt(rest)
            kept[number] = i
            number += 1
    return root, kept, number


@compiled
def solved(
    root: FloatArray, kept: IntArray, number: int, right: FloatArray, size: int
) -> FloatArray:
    """Return the solution of the normal equations, shape (size,); 0 where a row is left out."""
    half, out = np.empty(number), np.zeros(size)
    for i in range(number):
        value = right[kept[i]]
        for j in range(i):
            value -= root[i, j] * half[j]
        half[i] = value / root[i, i]
    for i in range(number - 1, -1, -1):
        value = half[i]
        for j in range(i + 1, number):
            value -= root[j, i] * out[kept[j]]
        out[kept[i]] = value / root[i, i]
    return out


@compiled
def lag_products(w: FloatArray, most: int) -> FloatArray:
    """Return Σ w[k − i] w[k − j] over k ≥ ``most`` for i ≤ j ≤ ``most``, the others 0.

    Products of one j − i differ by what enters and leaves the window.
    """
    end, out = len(w), np.zeros((most + 1, most + 1))
    for shift in range(most + 1):
        out[0, shift] = np.dot(w[most:], w[most - shift : end - shift])
        for i in range(1, most + 1 - shift):
            gained = w[most - i] * w[most - i - shift] - w[end - i] * w[end - i - shift]
            out[i, i + shift] = out[i - 1, i - 1 + shift] + gained
    return out
