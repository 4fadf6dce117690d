"""SE at every delay: small least-squares problems, several delays side by side, compiled."""

from typing import NamedTuple

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.lanes import LANES, put, row, spread, where_larger

DEPENDENT = 1e-13
RIDGE = 1e-12
SAME = 1e-9


class DelayRoom(NamedTuple):
    """One problem at a time."""

    # lagged products, row d those of lags that are d apart; as many as LANES delays need, 0 beyond
    # the last, shape (width, L')
    products: FloatArray
    right: FloatArray  # products with the rest, shape (L',)
    solving: FloatArray  # for the systems, shape (width + 3, width, LANES)


@compiled
def delay_room(width: int, lags: int) -> DelayRoom:
    """Return room for n_b and the number of lags."""
    size = max(lags, LANES + width - 1)
    solving = np.zeros((width + 3, width, LANES))
    return DelayRoom(np.zeros((width, size)), np.zeros(size), solving)


@compiled
def left_over(room: DelayRoom, rest: float, out: FloatArray) -> None:
    """Write SE at every delay, shape (T,): the rest's energy less bᵀ M⁻¹ b.

    M holds the lagged products of the lags from the delay on, b those with the rest. What the
    projected columns leave nothing of is rounding and explains nothing, and so does what
    explains more than all.
    """
    width, size = room.products.shape
    matrix, last = room.solving, LANES * width
    vector, diagonal = width * last, (width + 1) * last
    nothing, one = spread(0.0), spread(1.0)
    for begin in range(0, len(out), LANES):
        first = max(min(begin, len(out) - LANES), 0)
        usable = one
        for i in range(width):
            now = row(room.products, first + i)
            usable = where_larger(now, nothing, usable, nothing)
            put(matrix, diagonal + LANES * i, now)
            put(matrix, vector + LANES * i, row(room.right, first + i))
            for j in range(i):
                lagged = row(room.products, size * (i - j) + first + j)
                put(matrix, last * i + LANES * j, lagged)
            put(matrix, (last + LANES) * i, (1.0 + RIDGE * (1.0 + i)) * now)
        total = nothing
        for i in range(width):
            pivot = row(matrix, (last + LANES) * i)
            least = DEPENDENT * row(matrix, diagonal + LANES * i)
            inverse = where_larger(pivot, least, one / pivot, nothing)
            own = row(matrix, vector + LANES * i)
            total = total + own * (own * inverse)
            for j in range(i + 1, width):
                factor = row(matrix, last * j + LANES * i) * inverse
                to = vector + LANES * j
                put(matrix, to, row(matrix, to) - factor * own)
                for below in range(i + 1, j + 1):
                    to, of = last * j + LANES * below, last * below + LANES * i
                    put(matrix, to, row(matrix, to) - factor * row(matrix, of))
        used = where_larger(total, spread(rest * (1.0 + SAME)), nothing, total)
        used = where_larger(usable, nothing, used, nothing)
        left, floor = spread(rest) - used, spread(1e-12 * rest)
        end = (width + 2) * last
        put(matrix, end, where_larger(floor, left, floor, left))
        for t in range(first, min(first + LANES, len(out))):
            out[t] = matrix[width + 2, 0, t - first]


@compiled
def delay_energy(products: FloatArray, right: FloatArray, rest: float) -> FloatArray:
    """Return SE of stems at every delay, shape (G, T).

    Args:
        products: as :func:`.scan.step_products` returns them for one channel, shape
            (G, 1, width, L).
        right: shape (G, 1, L).
        rest: sum of squares of what the columns leave of the output.
    """
    width, lags = products.shape[2], products.shape[3]
    room = delay_room(width, lags)
    out = np.empty((len(products), lags - width + 1))
    for g in range(len(out)):
        for position in range(lags):
            room.right[position] = right[g, 0, position]
            for d in range(width):
                room.products[d, position] = products[g, 0, d, position]
        left_over(room, rest, out[g])
    return out


@compiled
def pattern_energy(
    products: FloatArray,
    right: FloatArray,
    level: float,
    rest: float,
    room: DelayRoom,
    out: FloatArray,
) -> None:
    """Write SE of one pattern base − level · sign at every delay, shape (T,).

    Args:
        products: of base with itself, base with sign, sign with itself, shape (3, width, L).
        right: of base and sign with the rest, shape (2, L).
    """
    width, lags = products.shape[1], products.shape[2]
    for position in range(lags):
        room.right[position] = right[0, position] - level * right[1, position]
        for d in range(width):
            now = products[0, d, position] - level * products[1, d, position]
            room.products[d, position] = now + level * level * products[2, d, position]
    left_over(room, rest, out)
