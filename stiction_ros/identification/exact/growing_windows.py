"""Beginnings of a record, each longer than the one before, up to the whole record."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.problem.models import Data, Model
from stiction_ros.identification.problem.output_error import Orders

TURN = 0.1
GROWTH = 1.2


def shortest_window(data: Data, orders: Orders, more: int = 0) -> int:
    """Return the fewest samples that a window may have.

    Args:
        more: free parameters beside those of the model.
    """
    free = 2 * orders.output + len(data.u) * orders.input + orders.noise + 3 + more
    return orders.first + 5 * free


def sample_of_turn(data: Data, valve: int, turns: int) -> int:
    """Return how many samples hold so many reversals of OP by a tenth of the limit."""
    u = data.u[valve]
    return samples_of_turns(u, TURN * float(data.limit[valve]), turns) or len(u)


def samples_of_turns(op: FloatArray, band: float, turns: int) -> int | None:
    """Return how many samples of OP hold so many reversals by ``band``; None: there are fewer."""
    moves = np.diff(HeStiction.simulate_grid(np.array([[band, band]]), op, float(op[0]))[:, 0])
    at = np.flatnonzero(moves)
    reversed_at = at[1:][np.sign(moves[at[1:]]) != np.sign(moves[at[:-1]])]
    return int(reversed_at[turns - 1]) + 1 if len(reversed_at) >= turns else None


def window_lengths(first: int, samples: int) -> list[int]:
    """Return the lengths of the windows, from ``first`` up to the whole record."""
    counts = [first]
    while counts[-1] < samples:
        counts.append(min(samples, int(GROWTH * counts[-1]) + 1))
    return counts


def beginning_of_data(data: Data, count: int) -> Data:
    """Return the first ``count`` samples."""
    return dataclasses.replace(
        data,
        y=np.ascontiguousarray(data.y[:, :count]),
        u=np.ascontiguousarray(data.u[:, :count]),
    )


def beginning_of_model(model: Model, count: int) -> Model:
    """Return the model with the first ``count`` samples of its stems."""
    return dataclasses.replace(model, stems=np.ascontiguousarray(model.stems[:, :count]))
