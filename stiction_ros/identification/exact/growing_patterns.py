"""Search for a switching pattern that is narrow: the record is taken in piece by piece.

The right pattern of a record may be less than a thousandth of the span wide, and its
neighbours, which slip once at another sample, much worse than wrong ones far away: no grid leads
there. In the first few slips the same pattern is a wide cell of the (J, S) plane. So cells are
searched on a beginning of the record; the best ones, and no others, are divided into the cells
of a longer beginning (:mod:`stiction_ros.identification.switching`), and so on up to the
whole record.

The stem before its first slip is left free, so only the sample of that slip has to be tried.
Few are: where OP is noisy, or the valve rests all through the first window, the right one may
not be among them, and the grids of :mod:`.search` are what is left.
"""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.exact.pattern_search import PatternSearch, points_of
from stiction_ros.identification.friction import TURN, even_grid, samples_of_turns
from stiction_ros.identification.problem.models import (
    FEWEST_MOVES,
    Criterion,
    Data,
    Model,
    with_valve,
)
from stiction_ros.identification.problem.output_error import Orders
from stiction_ros.identification.switching import Beginning, PatternScan, cells_at

LONGEST = 1500  # samples of a record that is searched so
GROWTH = 1.2  # of a window to the next
FIRST_TURNS = 3  # reversals of OP in the first window
FIRST_SLIPS = 3  # that are tried
STEPS = 60  # of the first window's grid
PARENTS = 20  # whose surroundings are listed
CROSSES = 10  # points through which lines are listed
CELLS_EACH = 50  # of one of these
THIN = 1e-7  # of the limit; half the width of a line
MOST_CELLS = 1000  # of a branch in a longer window
KEPT = 60  # cells that go on to a longer window
BIN = 0.03  # of the limit; squares of the (J, S) plane that may hold few of the cells kept
ALIKE = 5  # of them in one square
FITTED = 2


@dataclasses.dataclass(frozen=True)
class Branch:
    """Cells of one window that share their first slip."""

    search: PatternSearch  # the criterion on this window
    begin: Beginning  # the first slip
    scan: PatternScan  # the cells


def growing_patterns(data: Data, model: Model, valve: int) -> Model:
    """Return the best model found on growing windows, or ``model`` if none is better.

    Args:
        model: gives the stems of the other valves.
    """
    apart = BIN * float(data.limit[valve])
    lengths = window_lengths(first_window(data, model.orders, valve), data.y.shape[1])

    def search(begin: Beginning, count: int) -> PatternSearch:
        window, shown = data.part(0, count), model.beginning(count)
        return PatternSearch(window, shown, valve, begin=begin, criterion=Criterion.ONE_STEP)

    begins = first_slips(data.u[valve][: lengths[0]])
    if not begins:
        return model
    kept = [first_branch(search(begin, lengths[0]), begin) for begin in begins]
    for count in lengths[1:]:
        kept = [divided(branch, search(branch.begin, count)) for branch in thinned(kept, apart)]
    return _fitted(data, model, valve, kept)


def first_window(data: Data, orders: Orders, valve: int) -> int:
    """Return how many samples hold the first turns of OP and suffice for a fit."""
    lags = data.delay[1] - data.delay[0] + orders.input  # in each, the first level is free
    free = 2 * orders.output + len(data.u) * orders.input + orders.noise + 3 + lags
    u = data.u[valve]
    turned = samples_of_turns(u, TURN * float(data.limit[valve]), FIRST_TURNS) or len(u)
    return min(max(turned, orders.first + 5 * free), len(u))


def window_lengths(first: int, samples: int) -> list[int]:
    """Return the lengths of the windows, from ``first`` up to the whole record."""
    counts = [first]
    while counts[-1] < samples:
        counts.append(min(samples, int(GROWTH * counts[-1]) + 1))
    return counts


def first_slips(u: FloatArray) -> list[Beginning]:
    """Return the likeliest first slips of a valve that rests somewhere near its first OP.

    A valve slips first where OP goes beyond all it was before; the further beyond, the more
    stem positions there are from which it slips there.
    """
    beyond = np.diff(np.maximum.accumulate(u)) - np.diff(np.minimum.accumulate(u))
    farthest = np.sort(np.argsort(-beyond, kind="stable")[:FIRST_SLIPS]) + 1
    level = float(u[0])
    return [
        Beginning(level, int(k), float(np.sign(u[k] - level)))
        for k in farthest
        if beyond[k - 1] > 0.0
    ]


def first_branch(search: PatternSearch, begin: Beginning) -> Branch:
    """Return cells of the whole triangle.

    Those of an even grid, those round the best of them, and those on the lines of the same J
    and of the same S through what is then best, as far as ``CELLS_EACH`` goes.
    """
    apart, step = BIN * search.limit, search.limit / STEPS
    grid = points_of(even_grid(search.limit, STEPS))
    met = search.evaluate(cells_at(search.u, begin, grid, search.law).distinct())
    around = met.bounds[spread(met, apart, PARENTS, 1)] + step * np.array([-1.0, 1.0, -1.0, 1.0])
    near = search.some_cells(begin, around, PARENTS * CELLS_EACH)
    met = PatternScan.joined([met, near])
    lines = cross(met.bounds[spread(met, apart, CROSSES, ALIKE)], search.limit)
    return Branch(
        search,
        begin,
        PatternScan.joined([met, search.some_cells(begin, lines, CROSSES * CELLS_EACH)]),
    )


def cross(rectangles: FloatArray, limit: float) -> FloatArray:
    """Return two thin rectangles per row, through its middle, along S and along J."""
    inside, thin = np.clip(rectangles, 0.0, 2.0 * limit), THIN * limit
    jump, reverse = inside[:, :2].mean(axis=1), inside[:, 2:].mean(axis=1)
    none, most = np.zeros(len(inside)), np.full(len(inside), 2.0 * limit)
    along_s = np.column_stack([jump - thin, jump + thin, none, most])
    along_j = np.column_stack([none, most, reverse - thin, reverse + thin])
    return np.concatenate([along_s, along_j])


def divided(branch: Branch, longer: PatternSearch) -> Branch:
    """Return the cells of a longer window that the cells of a branch are made of.

    A cell of very small friction may be made of more than ``MOST_CELLS``; some are left out then.
    """
    cells = longer.some_cells(branch.begin, branch.scan.bounds, MOST_CELLS)
    return Branch(longer, branch.begin, cells)


def thinned(branches: list[Branch], apart: float) -> list[Branch]:
    """Return the best cells of all branches, few of them from the same place of the plane."""
    whole = PatternScan.joined([branch.scan for branch in branches])
    of = np.repeat(np.arange(len(branches)), [len(branch.scan.loss) for branch in branches])
    best = spread(whole, apart, KEPT, ALIKE)
    return [
        dataclasses.replace(branch, scan=whole.chosen(best[of[best] == i]))
        for i, branch in enumerate(branches)
        if (of[best] == i).any()
    ]


def spread(scan: PatternScan, apart: float, count: int, alike: int) -> IntArray:
    """Return the best cells, best first, at most ``alike`` in a square of the (J, S) plane.

    Args:
        apart: side of the squares, %.
        count: largest number of cells.
    """
    order = np.argsort(scan.loss, kind="stable")
    corners = np.floor(scan.bounds[order][:, [0, 2]].clip(0.0) / apart)
    _, square = np.unique(corners @ np.array([1.0, 1.0j]), return_inverse=True)
    together = np.argsort(square, kind="stable")
    first_of_square = np.searchsorted(square[together], square)
    place = np.empty(len(order), dtype=np.int64)
    place[together] = np.arange(len(order))
    return order[place - first_of_square < alike][:count]


def _fitted(data: Data, model: Model, valve: int, branches: list[Branch]) -> Model:
    """Return the best of the exact fits of the best cells and of ``model``."""
    cells = [
        (float(branch.scan.loss[i]), branch, int(i))
        for branch in branches
        for i in np.flatnonzero(branch.scan.moves >= FEWEST_MOVES)
    ]
    best = model
    for _, branch, i in sorted(cells, key=lambda cell: cell[0])[:FITTED]:
        friction, start = branch.search.realised(branch.scan, i, branch.begin)
        delays = branch.scan.delays[i]
        rival = with_valve(data, model, valve, friction, start, delays, warm=False)
        best = min(best, rival, key=lambda candidate: candidate.loss)
    return best
