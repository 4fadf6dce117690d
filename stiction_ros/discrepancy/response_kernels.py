"""Processes driven by many stems at once, compiled: rows are samples, columns are stems."""

from __future__ import annotations

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects import FloatArray


@compiled
def add_moving_sum(total: FloatArray, taps: FloatArray, stems: FloatArray) -> None:
    """Add Σ taps_i (x_{k−i} − x_0) to ``total`` in place; nothing moved before the start.

    Args:
        total: shape (N, G).
        taps: shape (n,).
        stems: x, shape (N, G), or (N, 1) for all columns.
    """
    count, size = total.shape
    alone = stems.shape[1] == 1
    for k in range(1, count):
        for i in range(min(len(taps), k)):
            factor = taps[i]
            if factor == 0.0:
                continue
            if alone:
                part = factor * (stems[k - i, 0] - stems[0, 0])
                for g in range(size):
                    total[k, g] += part
            else:
                for g in range(size):
                    total[k, g] += factor * (stems[k - i, g] - stems[0, g])


@compiled
def recurse(total: FloatArray, denominator: FloatArray) -> None:
    """Turn x into y of y_k = x_k − Σ a_i y_{k−i} in place, columns of shape (N, G).

    Args:
        denominator: 1, a_1, … a_n.
    """
    count, size = total.shape
    for k in range(1, count):
        for i in range(1, min(len(denominator), k + 1)):
            factor = denominator[i]
            for g in range(size):
                total[k, g] -= factor * total[k - i, g]


@compiled
def tank_states(
    first: FloatArray, second: FloatArray, flow: FloatArray, inlet: FloatArray, share: float
) -> FloatArray:
    """Return C or T of the stirred tank from rest, shape (N, G).

    Args:
        first, second: stems of both valves, shape (N, G) or (N, 1), %.
        flow: outflow is flow_0 + flow_1 x_1, m³/min.
        inlet: what flows in is inlet_0 + inlet_1 x_1 + inlet_2 x_2.
        share: sample time over volume, min/m³.
    """
    count = len(first)
    size = max(first.shape[1], second.shape[1])
    one, two = int(first.shape[1] > 1), int(second.shape[1] > 1)
    states = np.empty((count, size))
    state = np.empty(size)
    for k in range(count):
        for g in range(size):
            a, b = first[k, g * one], second[k, g * two]
            z = -share * (flow[0] + flow[1] * a)
            tail = 1.0 + z * (0.5 + z * (1.0 / 6.0 + z / 24.0))
            source = share * (inlet[0] + inlet[1] * a + inlet[2] * b) * tail
            if k == 0:
                state[g] = -source / (z * tail)
            states[k, g] = state[g]
            state[g] = (1.0 + z * tail) * state[g] + source
    return states
