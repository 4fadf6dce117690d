"""The paper's method: the nonlinear programme (12) from M starts, for every choice of delays.

1. Every start is solved for every choice of delays. A start on the border is far from the
   answer and climbs four values of τ, each from the last one's end: three of strong smoothing,
   where the criterion has one broad valley, then τ = 10⁴, where the smoothed law is He's. A
   start on the line of the apparent stiction is near and begins at τ = 10⁴.
2. At τ = 10⁴ the criterion is piecewise constant in f_S, so IPOPT improves f_D and the process
   but leaves f_S nearly where it was. The best ends, the best of the smoothed stages among
   them, are therefore restarted around themselves, in steps from 0.5 % downwards. Then the
   best neighbours at wide steps (4, 2 and 1 %), or with one valve released, are treated likewise.
3. All choices of delays are solved from there, and the best objective wins.

After every run of IPOPT the coefficients are solved once more with the frictions held, which
is linear least squares.

Values of τ between the two kinds are not used: under slow OP a moderately smoothed stem creeps
instead of jumping, and the criterion has spurious minima.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.apparent_stiction import apparent_stiction
from stiction_ros.identification.equation_error import Delays, evaluate
from stiction_ros.identification.friction_programme import (
    RESTART_ITERATIONS,
    FrictionProgramme,
    Solution,
)
from stiction_ros.identification.one_step_result import (
    Answer,
    check_record,
    delay_choices,
    friction_limits,
    result,
)
from stiction_ros.identification.options import IdentificationOptions
from stiction_ros.identification.programme_data import ProgrammeData
from stiction_ros.identification.results import FitStatus, Identification
from stiction_ros.identification.search_log import SearchLog, SolvedStart
from stiction_ros.identification.smoothed_stems import final_smoothing, smoothed_stems
from stiction_ros.identification.starts import STEP, Start, StartKind, draw_starts
from stiction_ros.records.record import Record

MAX_CHOICES = 500
ROUGH = (2.8, 4.0, 8.0)  # τ S_0 of the strongly smoothed stages
ENDS = 2
LEVELS = 4
HOPS = (8.0, 4.0, 2.0)  # in units of the reach
HOP_ENDS = 2
MAX_ROUNDS = 30
COMPASS = np.array([[1, 1], [-1, -1], [1, 0], [-1, 0], [0, 1], [0, -1], [1, -1], [-1, 1]])
Progress = Callable[[float], None]


@dataclasses.dataclass(frozen=True)
class _Candidate:
    """A point to go on from."""

    delays: Delays
    solution: Solution


def identify(
    record: Record,
    options: IdentificationOptions | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify by the nonlinear programme (12); see the module for the order of work.

    Args:
        record: what was measured.
        options: orders, delay range, ``starts``; None for the defaults.
        progress: called with the share done, 0 to 1.

    Returns:
        Point estimates without a verdict, and in ``search`` every start with its end. Its
        status is ``no_model`` when no start ended feasible with a stable process.

    Raises:
        InputError: a record that no model can be fitted to, or more than ``MAX_CHOICES``
            choices of delays.
    """
    begun = time.perf_counter()
    options = options or IdentificationOptions(method="nlp")
    search = _Search(record, options, progress or (lambda share: None))
    best = search.run()
    answer, objective = search.answer(best)
    found = evaluate(
        record, answer.friction, tuple(fit.delays for fit in answer.fits), search.orders
    )
    log = SearchLog(
        squared_error=found.squared_error,
        objective=objective,
        output_order=search.orders.output,
        input_order=search.orders.input,
        first=search.orders.first,
        points=len(search.starts) * len(search.choices),
        delays_tried=len(search.choices),
        starts=tuple(search.log),
    )
    return result(record, options, answer, log, time.perf_counter() - begun)


class _Search:
    def __init__(self, record: Record, options: IdentificationOptions, progress: Progress) -> None:
        self.record, self.progress = record, progress
        self.orders = check_record(record, options)
        self.choices = delay_choices(record, options, MAX_CHOICES)
        self.limits = friction_limits(record, options)
        found = apparent_stiction(record)
        apparent = np.array([entry.stiction for entry in found])
        self.starts = draw_starts(self.limits, np.minimum(apparent, self.limits), options.starts)
        scale = np.where(apparent > 0.0, np.minimum(apparent, self.limits), 0.3 * self.limits)
        self.rough = [factor / scale for factor in ROUGH]
        self.final = final_smoothing(self.limits)
        self.reach = np.minimum(STEP, self.limits / 20.0)
        self.data = ProgrammeData.of(record.op, record.pv, self.limits, self.orders)
        self.log: list[SolvedStart] = []

    def run(self) -> _Candidate | None:
        """Return the best accepted end, or None."""
        ends, roughs = self._all_starts()
        if not ends:
            self.progress(1.0)
            return None
        chosen = [*self._distinct(sorted(ends, key=_objective))[:ENDS], *roughs]
        refined = []
        for k, candidate in enumerate(chosen):
            refined.append(self._refine(candidate, self.reach))
            self.progress(0.6 + 0.25 * (k + 1) / len(chosen))
        best = min([*ends, *(end for end in refined if end.solution.accepted)], key=_objective)
        for hop in HOPS:
            best = self._hop(best, hop * self.reach)
        self.progress(0.95)
        for _ in range(2):
            other = self._other_delays(best)
            if other.delays == best.delays:
                break
            best = self._refine(other, self.reach / 2.0)
        self.progress(1.0)
        return best

    def _all_starts(self) -> tuple[list[_Candidate], list[_Candidate]]:
        """Return all accepted ends, and the best end of each smoothed stage."""
        ends: list[_Candidate] = []
        roughs: dict[int, _Candidate] = {}
        total, done = len(self.choices) * len(self.starts), 0
        for delays in self.choices:
            programme = FrictionProgramme(self.data, delays)
            for start in self.starts:
                stages = self._climb(programme, start)
                self._note(start, delays, stages)
                for stage, solution in enumerate(stages[:-1]):
                    candidate = _Candidate(delays, solution)
                    if solution.feasible and (
                        stage not in roughs or _objective(candidate) < _objective(roughs[stage])
                    ):
                        roughs[stage] = candidate
                if stages[-1].accepted:
                    ends.append(_Candidate(delays, stages[-1]))
                done += 1
                self.progress(0.6 * done / total)
        return ends, [roughs[stage] for stage in sorted(roughs)]

    def _climb(self, programme: FrictionProgramme, start: Start) -> list[Solution]:
        x, stages = programme.start(start.friction), []
        if start.kind is StartKind.BORDER:
            for smoothing in self.rough:
                stages.append(programme.solve(x, smoothing))
                x = stages[-1].x
        stages.append(programme.solve(x, self.final, self.reach))
        return stages

    def _note(self, start: Start, delays: Delays, stages: Sequence[Solution]) -> None:
        rough = stages[-2].friction if len(stages) > 1 else start.friction
        self.log.append(
            SolvedStart(
                kind=start.kind.value,
                delays=delays,
                start=_pairs(start.friction),
                rough=_pairs(rough),
                end=_pairs(stages[-1].friction),
                objective=stages[-1].objective,
                status=stages[-1].status,
                iterations=sum(stage.iterations for stage in stages),
                feasible=stages[-1].feasible,
                stable=stages[-1].stable,
            )
        )

    def _distinct(self, candidates: Sequence[_Candidate]) -> list[_Candidate]:
        """Return candidates without those next to an earlier one."""
        kept: list[_Candidate] = []
        for candidate in candidates:
            near = [
                other.delays == candidate.delays
                and bool(
                    (
                        np.abs(other.solution.friction - candidate.solution.friction).max(axis=1)
                        < self.reach
                    ).all()
                )
                for other in kept
            ]
            if not any(near):
                kept.append(candidate)
        return kept

    def _refine(self, candidate: _Candidate, reach: FloatArray) -> _Candidate:
        """Restart round the candidate as long as that helps, then with half the step."""
        programme = FrictionProgramme(self.data, candidate.delays)
        best = self._restart(programme, candidate.solution.friction, reach)
        finest = self.reach * 0.5**LEVELS
        for _ in range(MAX_ROUNDS):
            polled = self._poll(programme, self._around(best.friction, reach), reach / 2.0)
            better = [end for end in polled if end.accepted and not _beats(best, end)]
            if better:
                best = min(better, key=lambda end: end.objective)
                continue
            reach = reach / 2.0
            if (reach <= finest).all():
                break
        return _Candidate(candidate.delays, best)

    def _hop(self, best: _Candidate, step: FloatArray) -> _Candidate:
        """Refine the best neighbours at a wide step, those with one valve released included."""
        programme = FrictionProgramme(self.data, best.delays)
        friction = best.solution.friction
        released = [
            np.where(np.arange(len(friction))[:, None] == j, 0.0, friction)
            for j in range(len(friction))
            if friction[j].max() > step[j]
        ]
        polled = self._poll(programme, [*self._around(friction, step), *released], self.reach)
        ends = [_Candidate(best.delays, end) for end in polled if end.accepted]
        for other in self._distinct(sorted(ends, key=_objective))[:HOP_ENDS]:
            refined = self._refine(other, self.reach)
            if not _beats(best.solution, refined.solution):
                best = refined
        return best

    def _poll(
        self, programme: FrictionProgramme, points: Sequence[FloatArray], reach: FloatArray
    ) -> list[Solution]:
        """Solve from the more promising half of ``points``, judged by their own (12a)."""
        errors = [programme.fitted(point, self.final)[1] for point in points]
        order = np.argsort(errors, kind="stable")[: (len(points) + 1) // 2]
        return [self._restart(programme, points[index], reach) for index in order]

    def _restart(
        self, programme: FrictionProgramme, friction: FloatArray, reach: FloatArray
    ) -> Solution:
        x = programme.fitted(friction, self.final)[0]
        solution = programme.solve(x, self.final, reach, RESTART_ITERATIONS)
        start = Start(StartKind.RESTART, friction)
        self._note(start, programme.delays, [solution])
        return solution

    def _around(self, friction: FloatArray, reach: FloatArray) -> list[FloatArray]:
        """Return frictions with one valve's moved by ``reach``, within the triangle."""
        points = []
        for j, step in enumerate(reach):
            for direction in COMPASS:
                static, dynamic = friction[j] + step * direction
                if 0.0 <= dynamic <= static <= self.limits[j]:
                    moved = friction.copy()
                    moved[j] = static, dynamic
                    points.append(moved)
        return points

    def _other_delays(self, best: _Candidate) -> _Candidate:
        """Return the best choice of delays for this friction, the one at hand included."""
        for delays in self.choices:
            if delays == best.delays:
                continue
            programme = FrictionProgramme(self.data, delays)
            start = Start(StartKind.DELAY, best.solution.friction)
            x = programme.fitted(start.friction, self.final)[0]
            solution = programme.solve(x, self.final, self.reach / 4.0)
            self._note(start, delays, [solution])
            if solution.accepted and not _beats(best.solution, solution):
                best = _Candidate(delays, solution)
        return best

    def answer(self, best: _Candidate | None) -> tuple[Answer, float]:
        """Return the answer and its objective, (12a)."""
        if best is None:
            delays, friction = self.choices[0], np.zeros((len(self.limits), 2))
            found = evaluate(self.record, friction, delays, self.orders)
            reason = "no start ended feasible with a stable process"
            answer = Answer(FitStatus.NO_MODEL, reason, friction, found.fits, found.stems)
            return answer, found.squared_error
        models = FrictionProgramme(self.data, best.delays).frame.models(best.solution.x)
        friction = best.solution.friction
        stems = smoothed_stems(self.record.op, friction, self.final)
        fits = tuple(
            model.judged(y, stems, self.orders)
            for model, y in zip(models, self.record.pv.T, strict=True)
        )
        objective = float(np.mean([fit.squared_error for fit in fits]))
        return Answer(FitStatus.OK, "", friction, fits, stems), objective


def _objective(candidate: _Candidate) -> float:
    return candidate.solution.objective


def _beats(first: Solution, second: Solution) -> bool:
    """Return whether ``first`` is as good as ``second`` up to 1e-9, or better."""
    return first.accepted and first.objective <= second.objective * (1.0 + 1e-9)


def _pairs(friction: FloatArray) -> tuple[tuple[float, float], ...]:
    return tuple((float(static), float(dynamic)) for static, dynamic in friction)
