"""Delays of valves, by ARX equations of second order whose free runs fit best."""

import functools

import numpy as np

from stiction_ros.identification.linear.data import LinearData
from stiction_ros.signals.arx_fit import ArxOrders, stable_arx
from stiction_ros.signals.free_run import driven, fitted_free_run

ORDER = 2  # n_a and n_b
MAX_RADIUS = 0.9995
"""Largest root of A: the pole of an integrator that is fitted lies as near to 1 as this."""
MARGIN = 2.0
"""Of delays whose log likelihoods, times −2, differ by less, the longest is kept."""


def valve_delays(data: LinearData, low: int, high: int) -> tuple[int, ...]:
    """Return the delay of every valve, ``low`` to ``high`` samples, to the output that is first."""
    rows = [_delays(data, output, low, high) for output in range(len(data.outputs))]
    return tuple(int(delay) for delay in np.min(rows, axis=0))


def _delays(data: LinearData, output: int, low: int, high: int) -> tuple[int, ...]:
    """Return the delays to one output: one after the other is improved until none improves."""
    y, orders = data.y[output], ArxOrders(ORDER, ORDER, ORDER + high)
    target = y[orders.first :]

    @functools.cache
    def loss(delays: tuple[int, ...]) -> float:
        fit = stable_arx(y, data.u, delays, orders, radius=MAX_RADIUS)
        drive = driven(fit.b, delays, data.u, fit.constant)[orders.first :]
        missed = float(np.mean((target - fitted_free_run(fit.a, drive, target)) ** 2))
        return len(target) * float(np.log(max(missed, 1e-300)))

    before, delays = None, (low,) * len(data.valves)
    while delays != before:
        before = delays
        for j in range(len(delays)):
            rivals = [(*delays[:j], d, *delays[j + 1 :]) for d in range(low, high + 1)]
            delays = min(rivals, key=lambda rival: (loss(rival), rival))
    # A leading b near zero counts as delay.
    limit = loss(delays) + MARGIN
    for j in range(len(delays)):
        while delays[j] < high:
            longer = (*delays[:j], delays[j] + 1, *delays[j + 1 :])
            if loss(longer) > limit:
                break
            delays = longer
    return delays
