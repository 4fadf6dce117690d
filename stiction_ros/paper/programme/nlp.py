"""The nonlinear programme (12) within the paper's M × T runs of IPOPT.

Points of the triangle are ranked by their own (12a). Then, until M runs for each
of T choices of delays are spent:

1. every choice of delays is solved from its best points, far apart, with a third of the runs;
2. in turn, the best end so far is gone on from (the best of many points about it, one valve
   released, wider slopes, the other choices of delays), and the next best point is tried with the
   delays of the best end.

The best objective of a stable process wins.
"""

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.identification_options import Progress
from stiction_ros.paper import one_step_result as one_step
from stiction_ros.paper.paper_options import PaperOptions
from stiction_ros.paper.programme.friction_programme import FrictionProgramme
from stiction_ros.paper.programme.reduced_programme import Criterion, ReducedProgramme, StemTable
from stiction_ros.paper.programme.starts import apparent_stictions, around, candidates, draw_starts
from stiction_ros.paper.search_log import SolvedStart
from stiction_ros.paper.smoothed_laws import final_smoothing
from stiction_ros.records import Record
from stiction_ros.signals.arx_fit import ArxOrders, Delays

MAX_CHOICES = 500
NO_END = "no start ended feasible with a stable process"
POINTS = 2000  # inside the widest triangle, to choose starts from
OPENING = 3  # the first runs are a third of all
WIDTH = 0.05  # of f_max: first difference quotients from a start
NARROW = 0.025  # the same from an end
AROUND = 0.05  # of f_max: points about an end, to choose the next start from
NEARER = 0.3
POINTS_AROUND = 200
APART = 0.05  # of f_max: starts and ends nearer than that are one place


def search_at_its_best(
    record: Record, options: PaperOptions, orders: ArxOrders, progress: Progress
) -> one_step.Answer:
    """Return the end of the nonlinear programme (12); see the module for the order of work."""
    search = _Search(record, options, orders, progress)
    best = search.run()
    return one_step.Answer(
        "" if best else NO_END,
        np.array(best.end) if best else np.zeros((len(record.valves), 2)),
        best.delays if best else search.choices[0],
        best.objective if best else None,
        sum(one.criterion.evaluations for one in search.programmes.values()),
        starts=tuple(search.log),
    )


class _Search:
    def __init__(
        self, record: Record, options: PaperOptions, orders: ArxOrders, progress: Progress
    ) -> None:
        self.record, self.options, self.progress = record, options, progress
        self.choices = one_step.delay_choices(record, options, MAX_CHOICES)
        limits = one_step.friction_limits(record, options)
        self.table = StemTable(record, limits, orders, options.law)
        self.programmes = {
            delays: ReducedProgramme(Criterion(self.table, delays)) for delays in self.choices
        }
        self.budget = options.starts * len(self.choices)
        self.log: list[SolvedStart] = []
        self._tried: dict[Delays, list[FloatArray]] = {delays: [] for delays in self.choices}
        self._ranked = self._rank()

    def run(self) -> SolvedStart | None:
        """Return the best end, or None where no run ended feasible."""
        each = max(1, self.budget // OPENING // len(self.choices))
        for delays in self.choices:
            for _ in range(each):
                self._open(delays)
        onward: Iterator[tuple[FloatArray, Delays, float]] = iter(())
        begun_from: SolvedStart | None = None
        while len(self.log) < self.budget:
            best = best_of(self.log)
            if best is None:
                self._open(self.choices[len(self.log) % len(self.choices)])
                continue
            if best is not begun_from:
                onward, begun_from = self._onward(best), best
            step = next(onward, None)
            if step is not None:
                self._solve(*step)
            if len(self.log) < self.budget:
                self._open(best.delays)
        self.progress(1.0)
        return best_of(self.log)

    def _rank(self) -> dict[Delays, list[FloatArray]]:
        """Return all candidates, the best first, for each choice of delays."""
        stictions = np.minimum(apparent_stictions(self.record), self.table.limits)
        points = candidates(self.table.limits, stictions, POINTS)
        ranked = {}
        for delays, programme in self.programmes.items():
            values = [programme.criterion(point)[0] for point in points]
            ranked[delays] = [points[k] for k in np.argsort(values, kind="stable")]
        return ranked

    def _open(self, delays: Delays) -> None:
        """Solve from the best candidate that is not near a place tried before."""
        for start in self._ranked[delays]:
            if not self._near(start, self._tried[delays]):
                self._solve(start, delays, WIDTH)
                return
        self._solve(self._ranked[delays][0], delays, NARROW)

    def _near(self, friction: FloatArray, places: list[FloatArray]) -> bool:
        reach = APART * self.table.limits
        return any((np.abs(place - friction).max(axis=1) < reach).all() for place in places)

    def _onward(self, best: SolvedStart) -> Iterator[tuple[FloatArray, Delays, float]]:
        """Yield ways to go on from an end: nearer, a valve released, farther, other delays."""
        friction, criterion = np.array(best.end), self.programmes[best.delays].criterion
        for reach in (AROUND, NEARER * AROUND):
            near = [friction, *around(friction, self.table.limits, reach, POINTS_AROUND)]
            first = min(near, key=lambda point: criterion(point)[0])
            yield first, best.delays, NARROW
        for j in range(len(friction)):
            if friction[j].max() > 0.0 and len(friction) > 1:
                released = friction.copy()
                released[j] = 0.0
                yield released, best.delays, NARROW
        yield friction, best.delays, 4.0 * WIDTH
        value = {delays: self.programmes[delays].criterion(friction)[0] for delays in self.choices}
        for delays in sorted(self.choices, key=lambda delays: value[delays]):
            if delays != best.delays:
                yield friction, delays, NARROW

    def _solve(self, start: FloatArray, delays: Delays, width: float) -> None:
        start = self._released(start, self.programmes[delays].criterion)
        solved = self.programmes[delays].solve(start, width)
        end = np.array(solved.end)
        fits = one_step.evaluated(self.record, self.options, end, delays).fits
        stable = max(fit.largest_root for fit in fits) < 1.0
        self._tried[delays] += [start, end]
        self.log.append(dataclasses.replace(solved, stable=stable))
        self.progress(min(1.0, len(self.log) / self.budget))

    def _released(self, friction: FloatArray, criterion: Criterion) -> FloatArray:
        """Return the start, or the same with valves released as long as that lowers (12a)."""
        for j in range(len(friction) if len(friction) > 1 else 0):
            released = friction.copy()
            released[j] = 0.0
            if criterion(released)[0] < criterion(friction)[0]:
                friction = released
        return friction


def best_of(log: Sequence[SolvedStart]) -> SolvedStart | None:
    """Return the run of least (12a) that may win; None where none may."""
    accepted = [one for one in log if one.accepted]
    return min(accepted, key=lambda one: one.objective, default=None)


def search_as_printed(
    record: Record, options: PaperOptions, orders: ArxOrders, progress: Progress
) -> one_step.Answer:
    """Return the end of the method to the letter: (12) from M printed starts, for T delays.

    The best feasible, stable end of M × T runs of IPOPT at τ = 10⁴ wins.
    """
    choices = one_step.delay_choices(record, options, MAX_CHOICES)
    limits = one_step.friction_limits(record, options)
    stictions = np.minimum(apparent_stictions(record), limits)
    starts = draw_starts(limits, stictions, options.starts)
    smoothing = final_smoothing(limits)
    log: list[SolvedStart] = []
    for delays in choices:
        programme = FrictionProgramme(record, limits, orders, delays, options.law)
        for start in starts:
            log.append(programme.solve(start, smoothing))
            progress(len(log) / (len(choices) * len(starts)))
    accepted = best_of(log)
    best = accepted or min(log, key=lambda one: one.objective)
    return one_step.Answer(
        "" if accepted else NO_END,
        np.array(best.end) if accepted else np.zeros((len(limits), 2)),
        best.delays,
        best.objective,
        len(log),
        starts=tuple(log),
    )
