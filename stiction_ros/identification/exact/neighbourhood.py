"""The neighbourhood of a model: its best switching pattern, and all that are not rejected.

All cells in a rectangle of the (J, S) plane round the model are listed; the rectangle grows
until no accepted pattern touches its edge. Within it the optimum is exact under the prefilter
D/A at hand (:mod:`.pattern_search`).
"""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.exact.pattern_search import (
    PatternSearch,
    overlapping,
    points_of,
    remainders,
)
from stiction_ros.identification.problem.models import FEWEST_MOVES, Data, Model, with_valve
from stiction_ros.identification.switching import (
    Beginning,
    Cells,
    PatternScan,
    beginning_of,
    cells_at,
)

MOST_CELLS = 3000
CELL_SAMPLES = 3e7
SAMPLES = 6000  # up to which neighbourhoods are of full size
REJECTED = 1.0
GROWTHS = 14
MARGIN = 6.0
NEIGHBOURHOOD_ROUNDS = 4
LEAST_GAIN = 0.3


@dataclasses.dataclass(frozen=True)
class PatternMap:
    """The enumerated neighbourhood of a model."""

    begin: Beginning  # the first slip
    cells: Cells  # all that were met
    scan: PatternScan  # of these
    rectangle: FloatArray  # (J low, J high, S low, S high) that was enumerated, %
    closed: bool  # whether every pattern at its edge is rejected

    @property
    def patterns(self) -> int:
        """Number of cells."""
        return len(self.cells.distinct().bounds)


def neighbourhood(
    search: PatternSearch,
    begin: Beginning,
    friction: FloatArray,
    threshold: float,
    most: int,
    before: PatternMap | None = None,
) -> PatternMap:
    """Enumerate round (f_S, f_D), outwards until all patterns at the edge are rejected.

    Args:
        threshold: excess of the loss over the best from which a pattern is rejected.
        most: largest number of cells.
        before: the closed neighbourhood that holds (f_S, f_D), under another criterion; if its
            beginning is the same, its cells are evaluated again and not listed again.
    """
    if before is not None and before.begin.slips_alike(begin):
        cells, rectangle = [before.cells], before.rectangle
    else:
        centre = points_of(friction[None, :])
        cells = [cells_at(search.u, begin, centre, search.law)]
        reach = 0.002 * search.limit * min(1.0, SAMPLES / len(search.u))
        rectangle = np.repeat(centre[0], 2) + reach * np.array([-1.0, 1.0, -1.0, 1.0])
        rectangle[[0, 2]] = np.maximum(rectangle[[0, 2]], 0.0)
        first = search.enumerate(begin, rectangle[None, :], most)
        if first is None:
            scan = search.evaluate(cells[0])
            return PatternMap(begin, cells[0], scan, np.repeat(centre[0], 2), closed=False)
        cells.append(first)
    scan, closed = search.evaluate(Cells.joined(cells)), False
    for _ in range(GROWTHS):
        wider = _grown(scan, rectangle, threshold + MARGIN, search.limit)
        if (wider == rectangle).all():
            closed = True
            break
        strips = remainders(wider[None, :], rectangle[None, :])
        more = search.enumerate(begin, strips, most - len(scan.loss))
        if more is None:
            break
        cells.append(more)
        scan = PatternScan.joined([scan, search.evaluate(more)])
        rectangle = wider
    return PatternMap(begin, Cells.joined(cells), scan, rectangle, closed)


def _grown(scan: PatternScan, rectangle: FloatArray, threshold: float, limit: float) -> FloatArray:
    """Return the rectangle with every edge moved out that an accepted cell touches."""
    accepted = scan.bounds[scan.loss <= scan.loss.min() + threshold]
    accepted = accepted[overlapping(accepted, rectangle)]
    jl, jh, sl, sh = rectangle
    wide, high = max(0.3 * (jh - jl), 1e-6 * limit), max(0.3 * (sh - sl), 1e-6 * limit)
    out = rectangle.copy()
    if len(accepted):
        lowest, highest = accepted.min(axis=0), accepted.max(axis=0)
        if lowest[0] <= jl:
            out[0] = max(0.0, lowest[0] - wide)
        if highest[1] >= jh:
            out[1] = min(limit, highest[1] + wide)
        if lowest[2] <= sl:
            out[2] = max(0.0, lowest[2] - high)
        if highest[3] >= sh:
            out[3] = min(2.0 * limit, highest[3] + high)
    return np.array([min(out[0], jl), max(out[1], jh), min(out[2], sl), max(out[3], sh)])


def refine(
    data: Data, model: Model, valve: int, threshold: float, wander: int = 1
) -> tuple[Model, PatternMap | None]:
    """Return the model with the best pattern of its neighbourhood, and that neighbourhood.

    Repeated with the prefilter of the better model until nothing changes. The map is None
    for a valve without friction and one that never slips.

    Args:
        threshold: excess of the loss over the best from which a pattern is rejected.
        wander: how many samples delays may change in one round.
    """
    reachable = None
    for _ in range(NEIGHBOURHOOD_ROUNDS):
        if model.friction[valve, 0] <= 0.0:
            return model, None
        plain = PatternSearch(data, model, valve, wander)
        level = plain.best_level(model.friction[valve])
        begin = beginning_of(plain.u, level, float(model.friction[valve, 0]), data.law)
        if begin.first == len(plain.u):
            return model, None
        search = PatternSearch(data, model, valve, wander, begin)
        most = min(MOST_CELLS, int(CELL_SAMPLES / len(plain.u)))
        before = reachable if reachable is not None and reachable.closed else None
        reachable = neighbourhood(
            search, begin, model.friction[valve], threshold, most, before=before
        )
        found = reachable.scan
        loss = np.where(found.moves >= FEWEST_MOVES, found.loss, np.inf)
        best = int(loss.argmin())
        if not np.isfinite(loss[best]):
            break
        friction, start = plain.realised(found, best, begin)
        rival = with_valve(data, model, valve, friction, start, found.delays[best])
        if rival.loss > model.loss - LEAST_GAIN:
            break
        model = rival
    return model, reachable
