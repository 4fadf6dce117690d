"""Which frictions the record does not reject: profile likelihood over switching patterns."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.stats import chi2

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.friction_grid import around, coarse_grid
from stiction_ros.identification.models import Data, Model, ValveScan, scan_valve, with_valve
from stiction_ros.identification.output_error import Orders


@dataclasses.dataclass(frozen=True)
class FrictionIntervals:
    """Intervals of one valve.

    Attributes:
        static: f_S, union over all switching patterns that are not rejected, %.
        dynamic: f_D, %.
        static_estimate: middle of ``static`` if itself not rejected, otherwise the middle of
            the best pattern, %.
        dynamic_estimate: f_D of the best fit at ``static_estimate``, %.
        zero_loss: how much worse f_S = 0 is, in units of −2 log likelihood.
        deadband_loss: how much worse the best f_D = f_S is, same units.
    """

    static: tuple[float, float]
    dynamic: tuple[float, float]
    static_estimate: float
    dynamic_estimate: float
    zero_loss: float
    deadband_loss: float


def friction_intervals(
    data: Data, model: Model, orders: Orders, valve: int, confidence: float
) -> FrictionIntervals:
    """Return the intervals of one valve round the model's friction."""
    limit = float(data.limit[valve])
    centre = model.friction[valve]
    threshold = float(chi2.ppf(confidence, 1))
    grids = [np.zeros((1, 2)), coarse_grid(limit), _deadbands(limit)]
    step = limit / 30.0
    for _ in range(7):
        grids.append(around(centre[None, :], step, limit))
        step /= 3.0
    scan = scan_valve(data, model, orders, valve, np.vstack(grids), float(model.start[valve]))
    scan = _without_standstill(data, model, orders, valve, scan, threshold)
    for _ in range(2):
        best = int(scan.loss.argmin())
        middle = _pattern_middle(scan, best, limit)
        line = _line(middle, float(scan.grid[best, 1]), limit)
        scan = _joined(
            scan, scan_valve(data, model, orders, valve, line, float(model.start[valve]))
        )
    best = int(scan.loss.argmin())
    floor = float(scan.loss[best])
    accepted = scan.loss <= floor + threshold
    low = float(np.maximum(scan.stayed, scan.grid[:, 1])[accepted].min())
    high = float(np.minimum(scan.slipped, limit)[accepted].max())
    best_band = (_pattern_low(scan, best), min(float(scan.slipped[best]), limit))
    static = (min(low, best_band[0]), max(high, best_band[1]))
    estimate = 0.5 * (static[0] + static[1])
    probe = _line(estimate, float(scan.grid[best, 1]), limit)
    middle_scan = scan_valve(data, model, orders, valve, probe, float(model.start[valve]))
    if float(middle_scan.loss.min()) > floor + threshold:
        estimate = 0.5 * (best_band[0] + best_band[1])
        probe = _line(estimate, float(scan.grid[best, 1]), limit)
        middle_scan = scan_valve(data, model, orders, valve, probe, float(model.start[valve]))
    deadband = (scan.grid[:, 0] == scan.grid[:, 1]) & np.isfinite(scan.loss)
    return FrictionIntervals(
        static=static,
        dynamic=_dynamic_interval(scan, floor, threshold),
        static_estimate=estimate,
        dynamic_estimate=float(middle_scan.grid[int(middle_scan.loss.argmin()), 1]),
        zero_loss=float(scan.loss[0]) - floor,
        deadband_loss=float(scan.loss[deadband].min()) - floor,
    )


def _without_standstill(
    data: Data, model: Model, orders: Orders, valve: int, scan: ValveScan, threshold: float
) -> ValveScan:
    """Drop rows in which the stem hardly moves unless the exact fit does not reject them."""
    still = (scan.moves < data.min_moves) & (np.arange(len(scan.loss)) > 0)
    if not still.any():
        return scan
    index = int(np.where(still, scan.loss, np.inf).argmin())
    exact = with_valve(
        data,
        model,
        orders,
        valve,
        scan.grid[index],
        float(model.start[valve]),
        scan.delays[index],
        warm=False,
    )
    loss = scan.loss.copy()
    if exact.loss > model.loss + threshold:
        loss[still] = np.inf
    else:
        loss[still] = np.maximum(loss[still], loss[~still].min())
    return dataclasses.replace(scan, loss=loss)


def _deadbands(limit: float) -> FloatArray:
    values = limit * (np.arange(1, 81) / 80.0) ** 2
    return np.column_stack([values, values])


def _line(static: float, dynamic: float, limit: float) -> FloatArray:
    """Return rows of one f_S with f_D at geometric distances round ``dynamic``."""
    offsets = limit * 2.0 ** -np.arange(2.0, 16.0, 0.5)
    values = np.concatenate([[dynamic], dynamic + offsets, dynamic - offsets, [0.0, static]])
    values = np.unique(np.clip(values, 0.0, static))
    return np.column_stack([np.full(len(values), static), values])


def _pattern_low(scan: ValveScan, index: int) -> float:
    return float(max(scan.stayed[index], scan.grid[index, 1]))


def _pattern_middle(scan: ValveScan, index: int, limit: float) -> float:
    return 0.5 * (_pattern_low(scan, index) + min(float(scan.slipped[index]), limit))


def _joined(first: ValveScan, second: ValveScan) -> ValveScan:
    fields = [field.name for field in dataclasses.fields(ValveScan)]
    return ValveScan(
        *(np.concatenate([getattr(first, name), getattr(second, name)]) for name in fields)
    )


def _dynamic_interval(scan: ValveScan, floor: float, threshold: float) -> tuple[float, float]:
    """Return where the profile over f_D crosses the threshold, interpolated."""
    order = np.argsort(scan.grid[:, 1], kind="stable")
    dynamic, excess = scan.grid[order, 1], scan.loss[order] - floor
    values, groups = np.unique(dynamic, return_inverse=True)
    profile = np.full(len(values), np.inf)
    np.minimum.at(profile, groups, np.minimum(excess, 1e12))
    inside = np.flatnonzero(profile <= threshold)
    low, high = float(values[inside[0]]), float(values[inside[-1]])
    if inside[0] > 0:
        low = _crossing(values, profile, int(inside[0]), int(inside[0]) - 1, threshold)
    if inside[-1] + 1 < len(values):
        high = _crossing(values, profile, int(inside[-1]), int(inside[-1]) + 1, threshold)
    return low, high


def _crossing(
    values: FloatArray, profile: FloatArray, inside: int, outside: int, threshold: float
) -> float:
    near, far = np.sqrt(max(profile[inside], 0.0)), np.sqrt(profile[outside])
    share = float(np.clip((np.sqrt(threshold) - near) / max(far - near, 1e-12), 0.0, 1.0))
    return float(values[inside] + share * (values[outside] - values[inside]))
