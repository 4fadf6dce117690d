"""A law's further parameters, fitted beside the search for f_S and f_D."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.deferred import chi2_quantile
from stiction_ros.effects import FloatArray
from stiction_ros.identification.exact.pattern_search import nearby_delays
from stiction_ros.identification.friction.further import FurtherSearch, Judge, Settled, searched
from stiction_ros.identification.problem.models import (
    Criterion,
    Data,
    Model,
    scan_valve,
    with_valve,
)
from stiction_ros.identification.problem.output_error import Orders
from stiction_ros.identification.result.identification import ValveEstimate

EQUAL = 10.0
"""Loss by which other values than those they begin at must be better before the search."""
LEAST_GAIN = 0.5
FURTHER_FIT_ROUNDS = 3
FREEDOM = 3  # as of f_S and f_D alone; each further parameter is one more


def begun(data: Data, linear: Model, orders: Orders) -> Data:
    """Return the data with further parameters of least one-step error, valve by valve.

    Args:
        data: the record.
        linear: the model without friction.
        orders: of the process.
    """
    if not searched(data.law):
        return data
    for valve, first in enumerate(data.further):
        found = _search(data, linear, orders, valve, Criterion.ONE_STEP).everywhere()
        known = np.all(found.rows[:, 2:-1] == np.array(first), axis=1)
        if found.loss[0] < found.loss[known].min() - EQUAL:
            data = _with_further(data, valve, found.rows[0])
    return data


def settled(data: Data, model: Model, orders: Orders) -> tuple[Data, Model]:
    """Return data and model with further parameters and frictions improved together.

    Args:
        data: the record.
        model: found with the further parameters of ``data``.
        orders: of the process.
    """
    if not searched(data.law):
        return data, model
    for valve in np.flatnonzero(model.friction[:, 0]).tolist():
        for _ in range(FURTHER_FIT_ROUNDS):
            row = _nearby(data, model, orders, valve).rows[0]
            other = _with_further(data, valve, row)
            delays = np.array([each[valve] for each in model.delays])
            rival = with_valve(other, model, orders, valve, row[:2], float(row[-1]), delays)
            if not rival.loss < model.loss - LEAST_GAIN:
                break
            data, model = other, rival
    return data, model


def with_further_estimates(
    data: Data, model: Model, orders: Orders, valves: tuple[ValveEstimate, ...], confidence: float
) -> tuple[ValveEstimate, ...]:
    """Return the estimates with the further parameters, and intervals over all of them.

    What the record does not reject of f_S and f_D is wider where other values of the further
    parameters are as good.
    """
    if not data.further:
        return valves
    keys = [entry.key for entry in data.law.parameters()[2:]]
    slack = chi2_quantile(confidence, FREEDOM + len(keys))
    found = []
    for j, valve in enumerate(valves):
        if model.friction[j, 0] > 0.0 and not searched(data.law):
            held = dict(zip(keys, data.further_of(j), strict=True))
            valve = dataclasses.replace(valve, further=held)
        elif model.friction[j, 0] > 0.0:
            rows = _nearby(data, model, orders, j).accepted(slack)
            valve = widened(valve, dict(zip(keys, data.further_of(j), strict=True)), rows)
        found.append(valve)
    return tuple(found)


def widened(valve: ValveEstimate, further: dict[str, float], rows: FloatArray) -> ValveEstimate:
    """Return an estimate with further parameters, its intervals those of all accepted rows.

    Args:
        valve: as found with them held.
        further: their values.
        rows: (f_S, f_D, further …, start) that the record does not reject, shape (G, 3 + n).
    """
    low, high = rows.min(axis=0).tolist(), rows.max(axis=0).tolist()
    ends = {
        key: (min(low[2 + k], value), max(high[2 + k], value))
        for k, (key, value) in enumerate(further.items())
        if high[2 + k] > low[2 + k]
    }
    static, dynamic, band = valve.static_interval, valve.dynamic_interval, valve.band_interval
    if band is not None:
        sums = rows[:, :2].sum(axis=1)
        band = (min(band[0], float(sums.min())), max(band[1], float(sums.max())))
    return dataclasses.replace(
        valve,
        further=further,
        further_intervals=ends,
        static_interval=(min(static[0], low[0]), max(static[1], high[0])),
        dynamic_interval=(min(dynamic[0], low[1]), max(dynamic[1], high[1])),
        band_interval=band,
    )


def _with_further(data: Data, valve: int, row: FloatArray) -> Data:
    held = list(data.further)
    held[valve] = tuple(row[2:-1].tolist())
    return dataclasses.replace(data, further=tuple(held))


def _nearby(data: Data, model: Model, orders: Orders, valve: int) -> Settled:
    held = [*model.friction[valve], *data.further_of(valve), model.start[valve]]
    return _search(data, model, orders, valve, Criterion.INNOVATIONS).round_about(np.array(held))


def _search(
    data: Data, model: Model, orders: Orders, valve: int, criterion: Criterion
) -> FurtherSearch:
    ranges = data.delays
    if criterion is Criterion.INNOVATIONS:
        ranges = nearby_delays(data, model, valve, 0)

    def loss(rows: FloatArray) -> FloatArray:
        grid, starts = np.ascontiguousarray(rows[:, :-1]), rows[:, -1]
        scan = scan_valve(data, model, orders, valve, grid, starts, criterion, ranges)
        return np.where(scan.moves < data.min_moves, np.inf, scan.loss)

    judge: Judge = loss
    return FurtherSearch(data.law, float(data.limit[valve]), judge)
