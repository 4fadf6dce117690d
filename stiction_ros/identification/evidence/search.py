"""The frictions that explain a record best: seeds, polish, and what was met on the way.

One function judges, the loss of :mod:`.fit`. A seed is only where it is looked at first;
nothing is accepted that is worse than what is known, and everything that was fitted is kept.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.evidence.candidate import (
    Candidate,
    Judge,
    candidates_apart,
    fitted_from,
    ideal,
)
from stiction_ros.identification.evidence.fit_problem import LIMIT, Problem
from stiction_ros.identification.evidence.output_fit import (
    OutputFit,
    beginnings,
    fit_output,
    follow,
    white,
)
from stiction_ros.identification.friction import Judge as Losses
from stiction_ros.identification.friction import (
    coarse_grid,
    cross_grid,
    finer_grid,
    with_beginnings,
)
from stiction_ros.identification.growing import first_beginning, grown
from stiction_ros.identification.kernels.scan import rows_apart

SEEDS = 6  # frictions taken from one look at the whole triangle
APART = 0.03  # of the span of OP, by which they differ
DRIFT = 0.95
"""Of the noise 1 / (1 − .95 q⁻¹), under which PV is judged by its changes: the friction-free fit
takes what a friction leaves for noise, and under that noise all frictions look alike."""
NEAR = 0.01  # by which seeds from elsewhere differ
HEADS = 3  # candidates that are polished
HANDED = 2  # frictions of a valve that are tried elsewhere, as at the other rates
STEP = 0.03  # of the span: first step of the polish
FINEST = 1e-4
SHRINK = 2.5
LINES = 100  # steps along J and S over the span
THINNED = 3  # rows of the grid of which one is tried with other beginnings
STARTS = 41  # beginnings of a head
OFF = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])  # steps of a beginning, with those of friction
GAIN = 10.0  # of the loss: a friction that gains less is none to search another valve's beside
BETTER = 0.5  # of the loss: a seed from elsewhere that gains less is not polished
SWEEPS = 3  # searches of a valve, at most


@dataclasses.dataclass(frozen=True)
class Found:
    """What a search met."""

    best: Candidate  # the candidate of least loss
    ideal: Candidate  # the best fit without any friction
    # per valve, the best fit in which it has no friction and the others theirs
    without: tuple[Candidate, ...]
    met: tuple[Candidate, ...]  # every candidate, best first

    def heads(self, *valves: int) -> list[Candidate]:
        """Return the best with friction of each of ``valves``, none for all, to try elsewhere."""
        found = []
        for valve in valves or range(len(self.without)):
            rubbing = [one for one in self.met if one.friction[valve, 0] > 0.0]
            found += candidates_apart(rubbing, valve, HANDED, APART)
        return found


class _Valve:
    """The search over one valve's friction beside given other valves."""

    def __init__(
        self, problem: Problem, base: Candidate, valve: int, known: Sequence[Candidate] = ()
    ) -> None:
        """Begin beside the other valves of ``base``; what is ``known`` is not tried again."""
        self.problem, self.base, self.valve = problem, base, valve
        self.met: list[Candidate] = []
        self._last: tuple[Sequence[OutputFit], Judge] | None = None
        others = np.arange(len(problem.op)) != valve
        self._keys = {
            _key(self.row_of(one))
            for one in known
            if np.array_equal(one.friction[others], base.friction[others])
            and np.array_equal(one.starts[others], base.starts[others])
        }

    def add(
        self, row: FloatArray, fits: Sequence[OutputFit], *, whole: bool, anew: bool = False
    ) -> None:
        """Fit a row (f_S, f_D, start) from neighbouring fits.

        Args:
            row: of this valve.
            fits: of a neighbour.
            whole: until nothing changes.
            anew: also from where fits without neighbours begin.
        """
        key = _key(row)
        if key in self._keys and not whole:
            return
        self._keys.add(key)
        stems = self.base.stems.copy()
        stems[self.valve] = self.problem.stems(self.valve, row[None, :2], row[2])[0]
        if whole:
            found = tuple(
                fit_output(self.problem, i, stems, (fit, *((self.base.fits[i],) if anew else ())))
                for i, fit in enumerate(fits)
            )
        else:
            found = tuple(follow(self.problem, i, stems, f) for i, f in enumerate(fits))
        friction, starts = self.base.friction.copy(), self.base.starts.copy()
        friction[self.valve], starts[self.valve] = row[:2], row[2]
        self.met.append(Candidate(friction, starts, stems, found))

    def row_of(self, candidate: Candidate) -> FloatArray:
        """Return (f_S, f_D, start) of this valve."""
        return np.append(candidate.friction[self.valve], candidate.starts[self.valve])

    def look(self, fits: Sequence[OutputFit]) -> None:
        """Take the best of the whole triangle under the noise of ``fits``."""
        grid = coarse_grid(LIMIT)
        self._take(with_beginnings(grid, grid[::THINNED]), fits, SEEDS, APART)

    def grow(self, fits: Sequence[OutputFit]) -> None:
        """Take the best of what is found on growing beginnings of the record."""
        whole, base, valve = self.problem, self.base, self.valve

        def judged(count: int) -> Losses:
            return Judge.of(whole.beginning(count), base.beginning(count), valve, fits).losses

        rows, found = grown(
            judged, whole.rows, first_beginning(whole.op[valve], LIMIT, whole.rate), LIMIT
        )
        for i in rows_apart(rows[:, :2], found, SEEDS, APART):
            self.add(rows[i], fits, whole=False)

    def heads(self, count: int, distance: float) -> list[Candidate]:
        """Return the best that was met, frictions apart."""
        met = sorted(self.met, key=lambda one: one.loss)
        return candidates_apart(met, self.valve, count, distance)

    def settle(self, *, anew: bool = False) -> None:
        """Fit the heads until nothing changes; the first of them ``anew``, too."""
        for k, head in enumerate(self.heads(HEADS, APART)):
            self.add(self.row_of(head), head.fits, whole=True, anew=anew and k == 0)

    def polish(self) -> None:
        """Look closer and closer round the heads, and along the lines through them."""
        step = STEP
        for head in self.heads(HEADS, step):
            self._take(self._lines(head), head.fits, 2, step)
            self._begin(head)
        while step > FINEST:
            for head in self.heads(HEADS if step > 0.1 * STEP else 1, step):
                centre = head.friction[self.valve][None, :]
                self._near(finer_grid(centre, step / 3.0, LIMIT), head, 2, step / 3.0)
            step /= SHRINK
        self._begin(self.heads(1, 0.0)[0])

    def look_near(self, seed: Candidate, fits: Sequence[OutputFit]) -> None:
        """Take the best beside a friction from elsewhere, the stem's beginning kept."""
        grid = finer_grid(seed.friction[self.valve][None, :], NEAR, LIMIT)
        start = np.full(len(grid), seed.starts[self.valve])
        self._take(np.column_stack([grid, start]), fits, 1, 0.0)

    def _near(self, grid: FloatArray, head: Candidate, count: int, distance: float) -> None:
        friction, start = head.friction[self.valve], head.starts[self.valve]
        starts = np.clip(start + distance * OFF, -friction[0], friction[0])
        rows = [
            np.column_stack([grid, np.full(len(grid), start)]),
            np.column_stack([np.tile(friction, (len(OFF), 1)), starts]),
        ]
        self._take(np.vstack(rows), head.fits, count, distance)

    def _begin(self, head: Candidate) -> None:
        """Try where the stem may have been before the first sample: wherever it had stayed."""
        static = head.friction[self.valve][0]
        starts = static * np.linspace(-1.0, 1.0, STARTS)
        rows = np.column_stack([np.tile(head.friction[self.valve], (STARTS, 1)), starts])
        self._take(rows, head.fits, 1, 0.0)

    def _take(
        self, rows: FloatArray, fits: Sequence[OutputFit], count: int, distance: float
    ) -> None:
        found = self._judge(fits).losses(rows)
        for i in rows_apart(rows[:, :2], found, count, distance):
            self.add(rows[i], fits, whole=False)

    def _judge(self, fits: Sequence[OutputFit]) -> Judge:
        """Return what judges under ``fits``, kept as the same head is looked round many times."""
        if self._last is None or self._last[0] is not fits:
            self._last = (fits, Judge.of(self.problem, self.base, self.valve, fits))
        return self._last[1]

    def _lines(self, head: Candidate) -> FloatArray:
        """Return rows of the same J or S, with the stem's beginning and with its first slip kept.

        Slips that alternate tell S alone; what J is decides the first one, and with it the rest.
        """
        (static, dynamic), start = head.friction[self.valve], head.starts[self.valve]
        jump, band = np.array([static - dynamic]), np.array([static + dynamic])
        lines = cross_grid(jump, band, LIMIT, LINES)
        more = lines[:, 0] - static  # f_S: a slip upwards keeps f_S + start, one downwards less
        starts = np.concatenate([np.full(len(lines), start), start - more, start + more])
        rows = np.column_stack([np.tile(lines, (3, 1)), starts])
        return np.asarray(rows[np.abs(starts) <= rows[:, 0]])


def _key(row: FloatArray) -> tuple[float, ...]:
    """Return what tells a row (f_S, f_D, start) from others."""
    return tuple(round(float(value), 9) for value in row)


def search_valve(problem: Problem, base: Candidate, valve: int) -> list[Candidate]:
    """Return all candidates met in a search over the friction of one valve, best first."""
    looked = _Valve(problem, base, valve)
    drifting = [white(problem, i, base.stems, DRIFT) for i in range(len(base.fits))]
    if problem.rate == 1:
        looked.grow(drifting)
    else:
        looked.look(drifting)
    if looked.met:
        looked.settle(anew=True)
        looked.polish()
        looked.settle()
    return sorted([base, *looked.met], key=lambda one: one.loss)


def search(problem: Problem) -> Found:
    """Search the frictions of all valves, each anew when that of another has changed."""
    without = ideal(problem)
    met, best = [without], without
    due = list(range(len(problem.op)))
    for _ in range(SWEEPS * len(problem.op)):
        if not due:
            break
        valve = due.pop(0)
        found = search_valve(problem, best, valve)
        met += found
        if found[0].loss < best.loss - GAIN:
            best = found[0]
            others = (j for j in range(len(problem.op)) if j != valve and j not in due)
            due += others
    return _concluded(problem, met, without)


def search_again(problem: Problem, found: Found, seeds: Sequence[Candidate]) -> Found:
    """Return what is found with frictions that were best elsewhere, as at another rate.

    Args:
        problem: the record.
        found: by :func:`search`.
        seeds: of which frictions and beginnings are tried.
    """
    met, best = list(found.met), found.best
    for valve in range(len(problem.op)):
        tried = _Valve(problem, best, valve, found.met)
        rubbing = [seed for seed in seeds if seed.friction[valve, 0] > 0.0]
        for seed in candidates_apart(rubbing, valve, SEEDS, NEAR):
            tried.add(tried.row_of(seed), best.fits, whole=False)
            tried.look_near(seed, best.fits)
        tried.settle(anew=True)
        if min((one.loss for one in tried.met), default=np.inf) < best.loss - BETTER:
            tried.polish()
            tried.settle()
        met += tried.met
        best = min([best, *tried.met], key=lambda one: one.loss)
    if best is found.best:
        return found
    return _concluded(problem, met, found.ideal, tried=found.met[:HEADS])


def search_law(problem: Problem, found: Found, valve: int, seeds: Sequence[Candidate]) -> Found:
    """Return what is found under another law of one valve than before, as ``problem`` has it."""
    met = [one for one in found.met if not one.friction[valve].any()]
    met += search_valve(problem, found.without[valve], valve)
    told = search_again(problem, _concluded(problem, met, found.ideal), seeds)
    without = list(told.without)
    without[valve] = min(without[valve], found.without[valve], key=lambda one: one.loss)
    return dataclasses.replace(told, without=tuple(without))


def better(plain: Found, other: Found) -> Found:
    """Return the better of two searches of one record; no valve's rival is worse than in either."""
    best = min(plain, other, key=lambda found: found.best.loss)
    pairs = zip(plain.without, other.without, strict=True)
    without = tuple(min(pair, key=lambda candidate: candidate.loss) for pair in pairs)
    return dataclasses.replace(best, without=without)


def _concluded(
    problem: Problem, met: list[Candidate], without: Candidate, tried: Sequence[Candidate] = ()
) -> Found:
    """Return what is found.

    Args:
        problem: the record.
        met: every candidate.
        without: the best fit without friction, not yet fitted from the best of these.
        tried: but from these it has been.
    """
    met = sorted(met, key=lambda one: one.loss)
    fresh = [one for one in met[:HEADS] if all(one is not other for other in tried)]
    without = fitted_from(problem, without, fresh)
    met = sorted([without, *met], key=lambda one: one.loss)
    return Found(met[0], without, _one_by_one(problem, met, without), tuple(met))


def _one_by_one(
    problem: Problem, met: list[Candidate], without: Candidate
) -> tuple[Candidate, ...]:
    """Return per valve the best candidate without its friction, once fitted for itself."""
    if len(problem.op) == 1:
        return (without,)
    told = []
    for valve in range(len(problem.op)):
        best = met[0]
        friction, starts, stems = best.friction.copy(), best.starts.copy(), best.stems.copy()
        friction[valve], starts[valve] = 0.0, 0.0
        stems[valve] = problem.ideal_stems()[valve]
        known = [one for one in met if not one.friction[valve].any()]
        if not any(np.array_equal(one.stems, stems) for one in (best, without)):
            fits = tuple(
                fit_output(problem, i, stems, (*beginnings(problem, i), fit))
                for i, fit in enumerate(best.fits)
            )
            known.append(Candidate(friction, starts, stems, fits))
        told.append(min(known, key=lambda one: one.loss))
    return tuple(told)
