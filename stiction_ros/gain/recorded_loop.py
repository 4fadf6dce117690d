"""A recorded loop that can be run again otherwise.

The identified friction, the controller recovered from SP, PV and OP, how PV answers the stems
(:mod:`stiction_ros.gain.answering`), and what comes from outside: what nobody could have known of a
PV a sample before. With the friction of the record the loop repeats the record; with anything
changed it shows what would have been.
Signals are in units of their own movement, see
:mod:`stiction_ros.identification.closed_loop.scaled_loop`.
"""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.gain.answering import Answering
from stiction_ros.gain.draws import (
    CANDIDATES,
    DRAWS,
    TEMPER,
    Draws,
    drawn_frictions,
    drawn_tunings,
    possible_frictions,
    resampled,
)
from stiction_ros.gain.measures import Measures, Yardstick, cycle_period
from stiction_ros.identification.closed_loop.closed_loop import (
    op_cycles,
    output_oscillation,
    paired,
)
from stiction_ros.identification.closed_loop.scaled_loop import (
    EXACT,
    ScaledLoop,
    free_run,
    scaled,
    scaled_process,
    set_points_of,
)
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.outside_waves import outside_wave
from stiction_ros.identification.evidence.rates import LEAST_ROWS, RATES
from stiction_ros.identification.friction import find_law, simulate
from stiction_ros.identification.result import FitStatus, Identification, ValveEstimate, VerdictKind
from stiction_ros.loop.linear_loops import Controllers, Process
from stiction_ros.loop.repeated_loops import (
    Control,
    Equations,
    Laws,
    RecoveredControl,
    Stems,
    run_again,
)
from stiction_ros.records.record import Record
from stiction_ros.signals.controller_recovery import RecoveredController
from stiction_ros.signals.holds import holds
from stiction_ros.signals.oscillation import NEEDED_CYCLES

MOST = 4000
"""Samples that are run again, the last ones: hundreds of cycles say no more."""

EMBEDDING_SAMPLES = 1000
"""Samples of a run of the embedding, the last ones."""

TAKEN_OVER = 200
"""Samples before this run that the controller takes over, no more than a third of all."""


@dataclasses.dataclass(frozen=True)
class RecordedLoop:
    """One valve in its loop; signals scaled, rows those that are run again."""

    record: Record  # what was measured
    estimates: tuple[ValveEstimate, ...]  # of all valves
    loop: ScaledLoop  # the scaled signals
    process: Process  # equation (9) as identified
    # per valve the output of its controller, −1 for none, and the controller
    pairs: tuple[tuple[int, RecoveredController], ...]
    valve: int  # valve, output: indices of what is looked at
    output: int
    begin: int  # first sample that is looked at
    rows: tuple[int, int]  # first row that is run, and the one behind the last
    answers: tuple[Answering, ...]  # how each output is explained from sample ``begin`` on
    yardstick: Yardstick  # measures of a run

    @classmethod
    def of(cls, record: Record, found: Identification, valve: str | None = None) -> "RecordedLoop":
        """Return the loop of a valve; of the one with the widest band when none is named.

        Raises:
            InputError: no model, no such valve, or no controller that explains OP.
        """
        if found.status is not FitStatus.OK:
            raise InputError(f"there is no model to simulate: {found.reason}", where=record.name)
        loop = scaled(record, found.stem, EXACT)
        if loop is None:
            raise InputError("OP or PV does not move in automatic", where=record.name)
        chosen = _chosen(found, valve, record)
        pairs = tuple(paired(loop, op_cycles(loop)[1]))
        output, law = pairs[chosen]
        if output < 0:
            raise InputError(
                f"no controller of {record.valves[chosen]} can be recovered: {law.reason}",
                where=record.name,
                fix="give a record in automatic, with SP and OP not rounded away",
            )
        process = scaled_process(found.outputs, record.valves, loop)
        first, last = loop.longest
        first = max(first, last - MOST)
        answers = _answers(record, loop, process, (first, last))
        past = max(*(one.past for one in answers), 4 + max(law.lag for _, law in pairs))
        period = cycle_period(output_oscillation(loop, output))
        rows = slice(first + past, last)
        stretches = holds(law.set_point[rows, None])
        if period is not None and max(b - a for a, b in stretches) < NEEDED_CYCLES * period:
            stretches = [(0, rows.stop - rows.start)]
        return cls(
            record=record,
            estimates=found.valves,
            loop=loop,
            process=process,
            pairs=pairs,
            valve=chosen,
            output=output,
            begin=first,
            rows=(first + past, last),
            answers=answers,
            yardstick=Yardstick(record.sample_time, period is not None, stretches),
        )

    @property
    def estimate(self) -> ValveEstimate:
        """Friction of the valve that is looked at."""
        return self.estimates[self.valve]

    @property
    def law(self) -> RecoveredController:
        """The controller of the valve, between scaled signals."""
        return self.pairs[self.valve][1]

    @property
    def op_scale(self) -> float:
        """% of a scaled OP of 1."""
        return float(self.loop.op_scale[self.valve])

    @property
    def pv_scale(self) -> float:
        """Engineering units of a scaled PV of 1."""
        return float(self.loop.pv_scale[self.output])

    @property
    def load(self) -> FloatArray:
        """What the identified process, run freely, leaves of PV in the rows, shape (n, p)."""
        simulated = free_run(self.process, self.loop, self.loop.stem)
        rows = slice(*self.rows)
        return np.asarray(self.loop.pv[rows] - simulated[rows])

    @property
    def set_points(self) -> FloatArray:
        """Set-points of the record, recorded or found, shape (N, p)."""
        return set_points_of(self.loop, self.pairs)

    def now(self) -> Measures:
        """Return the measures of the record itself."""
        rows = slice(*self.rows)
        error = self.loop.pv[rows, self.output] - self.law.set_point[rows]
        stem = self.loop.stem[rows, self.valve]
        return self.yardstick.measure(self.pv_scale * error, self.op_scale * stem)

    def embedding_part(self) -> "RecordedLoop":
        """Return the loop with the rows on which the embedding is run, behind those taken over."""
        first, last = self.loop.longest
        ahead = first + min(TAKEN_OVER, (last - first) // 3)
        row = max(self.rows[0], last - EMBEDDING_SAMPLES, ahead)
        ahead = row - self.rows[0]
        stretches = [(max(a - ahead, 0), b - ahead) for a, b in self.yardstick.stretches]
        yardstick = dataclasses.replace(
            self.yardstick, stretches=[(a, b) for a, b in stretches if b > 0]
        )
        return dataclasses.replace(self, rows=(row, last), yardstick=yardstick)

    def drawn(self, random: np.random.Generator) -> Draws:
        """Return loops that the identification does not tell apart.

        Of each friction the stem is known, and by the stem how PV may answer it: of the likeliest
        loops by the likeliest equations, of the others by some that the record does not tell apart.
        What they leave comes from outside, so that each loop repeats the record.
        """
        verdict = self.estimate.verdict
        pairs = drawn_frictions(self.estimate, CANDIDATES, random)
        frictions = resampled(pairs, self._losses(pairs), verdict, random)
        return self._answered(frictions, 2 if verdict is VerdictKind.UNDECIDED else 1, random)

    def possible(self, random: np.random.Generator) -> Draws:
        """Return loops as :meth:`drawn`, whose jumps are as uncertain as those of the field."""
        pairs = possible_frictions(self.estimate, CANDIDATES, random)
        losses = self._losses(pairs) / TEMPER
        return self._answered(resampled(pairs, losses, self.estimate.verdict, random), 1, random)

    def _answered(
        self, frictions: FloatArray, likeliest: int, random: np.random.Generator
    ) -> Draws:
        """Return the loops of frictions, %, shape (DRAWS, 2)."""
        tunings = drawn_tunings(self.law, DRAWS, random)
        stems = self._stems(frictions)
        number, length = len(stems), stems.shape[2]
        delay = np.array([one.delay for one in self.answers])
        lags = self.answers[0].lags
        a, b = np.empty((number, len(delay), lags)), np.empty((number, *delay.shape, lags))
        outside = np.zeros((number, len(delay), length))
        for i, answering in enumerate(self.answers):
            for r in range(number):
                answer = answering.fit(stems[r].T)
                weights = answer.mean if r < likeliest else answer.drawn(random)
                a[r, i], b[r, i] = answer.split(weights)
                outside[r, i] = answering.left(stems[r].T, weights)
        return Draws(frictions, tunings, stems, Equations(a, b, delay, outside), likeliest)

    def _losses(self, frictions: FloatArray) -> FloatArray:
        """Return −2 log of the likelihood of frictions, shape (C,)."""
        return np.array(
            [sum(one.loss(stem.T) for one in self.answers) for stem in self._stems(frictions)]
        )

    def _stems(self, frictions: FloatArray) -> FloatArray:
        """Return the stems of all valves by frictions of the one, scaled, shape (C, m, N)."""
        number, j, whole = len(frictions), self.valve, slice(self.begin, self.rows[1])
        mean = float(self.loop.op_mean[j])
        stems = np.repeat(self.loop.stem[whole].T[None], number, axis=0)
        op = self.loop.op[whole, j] * self.op_scale + mean
        start = float(self.loop.stem[self.begin, j]) * self.op_scale + mean
        law, further = find_law(self.estimate.law), self.estimate.further_values
        moved = simulate(law, frictions, op, start, further).T
        moved[frictions[:, 0] <= 0.0] = op
        stems[:, j] = (moved - mean) / self.op_scale
        return stems

    def _laws(self, frictions: FloatArray) -> Laws:
        """Return the laws of all valves by frictions of the one, %, shape (C, 2)."""
        laws, j = [valve.behaviour() for valve in self.estimates], self.valve
        own = (self.estimate.with_frictions(*pair).behaviour() for pair in frictions.tolist())
        return [[*laws[:j], law, *laws[j + 1 :]] for law in own]

    def run(
        self, draws: Draws, tunings: FloatArray | None = None, *, serviced: bool = False
    ) -> list[Measures | None]:
        """Return the measures of drawn loops, as they are or with something changed.

        Args:
            draws: R loops.
            tunings: of its controller in place of those drawn, scaled, shape (R, 3).
            serviced: whether the valve has no friction.

        Returns:
            None for a run that grows without end.
        """
        own = np.array([law.coefficients for _, law in self.pairs])
        tuning = np.repeat(own[None], len(draws), axis=0)
        tuning[:, self.valve] = draws.tunings if tunings is None else tunings
        sp, pv = self.set_points[self.begin : self.rows[1]], self.loop.pv[self.begin : self.rows[0]]
        control = RecoveredControl(Controllers.of(self.pairs), tuning, sp, pv)
        return self.under(control, draws, serviced=serviced)

    def under(
        self, control: Control, draws: Draws, *, serviced: bool = False
    ) -> list[Measures | None]:
        """Return the measures of drawn loops under a controller, as :meth:`run` does."""
        whole, past = slice(self.begin, self.rows[1]), slice(self.begin, self.rows[0])
        laws = self._laws(0.0 * draws.frictions if serviced else draws.frictions)
        op, units = self.loop.op, (self.loop.op_mean, self.loop.op_scale)
        stem, sample_time = self.loop.stem[self.begin], self.record.sample_time
        pv, stems = run_again(
            draws.equations,
            draws.stems[:, :, : past.stop - past.start],
            Stems(laws, op[past], stem, units, sample_time),
            control,
            (op[whole], self.loop.pv[whole]),
        )
        errors = pv[:, :, self.output] - self.set_points[slice(*self.rows), self.output]
        return [
            self.yardstick.measured(self.pv_scale * error, self.op_scale * moved)
            for error, moved in zip(errors, stems[:, :, self.valve], strict=True)
        ]


def _answers(
    record: Record, loop: ScaledLoop, process: Process, span: tuple[int, int]
) -> tuple[Answering, ...]:
    """Return how each output is explained in a span of the samples of ``loop``."""
    ahead = len(record) - len(loop.op)
    part = record.part(ahead + span[0], ahead + span[1])
    rates = [rate for rate in RATES if rate == 1 or len(part) // rate >= LEAST_ROWS]
    problems = [Problem.of(part, None, rate) for rate in rates]
    samples = slice(*span)
    answers = []
    for i in range(len(record.outputs)):
        wave = outside_wave(problems, i)
        lines = np.array([] if wave is None else wave.lines, dtype=np.float64)
        pv, stems = loop.pv[samples, i].copy(), loop.stem[samples]
        answers.append(Answering.of(pv, stems, process.delay[i], lines))
    return tuple(answers)


def _chosen(found: Identification, name: str | None, record: Record) -> int:
    if name is None:
        shares = [valve.band_share for valve in found.valves]
        return int(np.argmax(shares))
    if name not in record.valves:
        raise InputError(f"no valve {name!r}", where="--valve", fix=", ".join(record.valves))
    return record.valves.index(name)
