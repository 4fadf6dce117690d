"""Which frictions the record does not reject: profile likelihood over switching patterns."""

import dataclasses

import numpy as np

from stiction_ros.deferred import chi2_quantile
from stiction_ros.identification.exact.neighbourhood import refine
from stiction_ros.identification.exact.pattern_search import PatternSearch, best_in_cells, points_of
from stiction_ros.identification.friction import coarse_grid
from stiction_ros.identification.problem.models import (
    FEWEST_MOVES,
    Data,
    Model,
    ValveScan,
    with_valve,
)
from stiction_ros.identification.switching import PatternScan

# f_S, f_D and one more for the choice among very many patterns.
FREEDOM = 3
FAR = 40

Interval = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class FrictionIntervals:
    """Intervals of one valve."""

    static: Interval  # f_S, union over all switching patterns that are not rejected, %
    dynamic: Interval  # f_D, %
    # middle of ``static`` if itself not rejected, otherwise the middle of the best pattern, %
    static_estimate: float
    dynamic_estimate: float  # f_D of the best fit, %
    deadband_loss: float  # how much worse the best f_D = f_S is, in units of −2 log likelihood
    # number of switching patterns enumerated round the best one; 0 when the valve does not slip
    patterns: int
    closed: bool  # whether that enumeration reached rejected patterns on every side
    model: Model  # the model with the best pattern


def friction_intervals(
    data: Data, model: Model, valve: int, confidence: float
) -> FrictionIntervals:
    """Return the intervals of one valve round the model's friction, at the model's delays."""
    limit = float(data.limit[valve])
    threshold = chi2_quantile(confidence, FREEDOM)
    model, near = refine(data, model, valve, threshold, wander=0)
    search = PatternSearch(data, model, valve, wander=0)
    scan = _far_patterns(search, float(model.start[valve]))
    if near is not None:
        scan = PatternScan.joined([scan, near.scan])
    scan = _without_standstill(data, model, valve, scan, threshold)
    floor = float(scan.loss.min())
    accepted = np.flatnonzero(scan.loss <= floor + threshold).tolist()
    dynamics = [scan.accepted_dynamic(i, floor + threshold - float(scan.loss[i])) for i in accepted]
    statics = [scan.static_range(i, each) for i, each in zip(accepted, dynamics, strict=True)]
    lows, highs = zip(*statics, strict=True)
    static = min(float(min(lows)), limit), min(float(max(highs)), limit)
    dynamic = min(low for low, _ in dynamics), max(high for _, high in dynamics)
    estimate = _estimate(scan, accepted, static, limit)
    return FrictionIntervals(
        static=static,
        dynamic=dynamic,
        static_estimate=estimate[0],
        dynamic_estimate=estimate[1],
        deadband_loss=_deadband_loss(scan) - floor,
        patterns=0 if near is None else near.patterns,
        closed=near is not None and near.closed,
        model=model,
    )


def _far_patterns(search: PatternSearch, start: float) -> PatternScan:
    """Return no friction, the patterns of deadbands and those of the best of a coarse grid."""
    limit = search.limit
    coarse = search.scan(coarse_grid(limit), start)
    chosen = coarse.grid[np.argsort(coarse.loss, kind="stable")[:FAR]]
    deadbands = np.repeat(limit * (np.arange(1, 41) / 40.0) ** 2, 2).reshape(-1, 2)
    cells = best_in_cells(search, np.vstack([chosen, deadbands]), start)[1]
    return PatternScan.joined([point_patterns(search.scan(np.zeros((1, 2)), start)), cells])


def _without_standstill(
    data: Data, model: Model, valve: int, scan: PatternScan, threshold: float
) -> PatternScan:
    """Drop patterns in which the stem hardly moves unless the record does not reject them.

    They are judged by the scan and, where that does not reject them, by the exact fit.
    """
    still = (scan.moves < FEWEST_MOVES) & (np.arange(len(scan.loss)) > 0)
    if not still.any():
        return scan
    if scan.loss[still].min() > scan.loss[~still].min() + threshold:
        return dataclasses.replace(scan, loss=np.where(still, np.inf, scan.loss))
    index = int(np.where(still, scan.loss, np.inf).argmin())
    exact = with_valve(
        data,
        model,
        valve,
        np.array(scan.middle(index, float(data.limit[valve]))),
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


def _estimate(
    scan: PatternScan, accepted: list[int], static: Interval, limit: float
) -> tuple[float, float]:
    """Return f_S in the middle of its interval where a pattern there is accepted, and f_D."""
    middle = 0.5 * (static[0] + static[1])
    f_s, f_d = scan.middle(int(scan.loss.argmin()), limit)
    for index in accepted:
        level = float(scan.level[index])
        low, high = scan.static_range(index, (level, level))
        if low <= middle <= high:
            return float(max(middle, f_d)), f_d
    return float(f_s), f_d


def _deadband_loss(scan: PatternScan) -> float:
    """Return the lowest loss of the patterns that allow J = 0, at f_D = f_S = S / 2."""
    flat = scan.bounds[:, 0] <= 0.0
    if not flat.any():
        return float("inf")
    low, high = 0.5 * scan.bounds[flat, 2], 0.5 * scan.bounds[flat, 3]
    away = scan.level[flat] - np.clip(scan.level[flat], low, high)
    return float((scan.loss[flat] + 0.5 * scan.curvature[flat] * away**2).min())


def point_patterns(scan: ValveScan) -> PatternScan:
    """Return grid points as patterns without extent."""
    points = points_of(scan.grid)
    f_d = scan.grid[:, 1]
    return PatternScan(
        np.column_stack([points[:, 0], points[:, 0], points[:, 1], points[:, 1]]),
        np.column_stack([f_d, f_d]),
        f_d,
        np.zeros(len(f_d)),
        scan.loss,
        scan.delays,
        scan.moves,
    )
