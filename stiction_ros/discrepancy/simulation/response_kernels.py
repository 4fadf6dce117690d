"""Processes driven by many stems at once, compiled: rows are samples, columns are stems."""

from __future__ import annotations

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects import FloatArray


@compiled
def filtered(
    taps: FloatArray, denominator: FloatArray, stems: FloatArray, more: FloatArray
) -> FloatArray:
    """Return y_k = Σ taps_i (x_{k−i} − x_0) + more_k − Σ a_i y_{k−i}, at rest before the start.

    Args:
        taps: shape (n,).
        denominator: 1, a_1, … a_n.
        stems: x, shape (N, G).
        more: shape (N,), for all columns.
    """
    count, size = stems.shape
    out = np.empty((count, size))
    for k in range(count):
        for g in range(size):
            out[k, g] = more[k]
        for i in range(min(len(taps), k)):
            factor = taps[i]
            if factor != 0.0:
                for g in range(size):
                    out[k, g] += factor * (stems[k - i, g] - stems[0, g])
        for i in range(1, min(len(denominator), k + 1)):
            factor = denominator[i]
            for g in range(size):
                out[k, g] -= factor * out[k - i, g]
    return out


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
