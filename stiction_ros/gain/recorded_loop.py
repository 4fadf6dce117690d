"""A recorded loop that can be run again otherwise.

The identified process and friction, the controller recovered from SP, PV and OP, and the load:
what the process, driven by the estimated stems, leaves of PV. With the friction of the record
and its load the loop repeats the record; with anything changed it shows what would have been.
Signals are in units of their own movement, see
:mod:`stiction_ros.identification.closed_loop.scaled_loop`.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.gain.measures import Measures, Yardstick, cycle_period
from stiction_ros.gain.stems import stems_of
from stiction_ros.identification.closed_loop.closed_loop import output_oscillation, paired
from stiction_ros.identification.closed_loop.loop_run import Process, Runs, run_loops
from stiction_ros.identification.closed_loop.oscillation import oscillation
from stiction_ros.identification.closed_loop.recovered_controller import RecoveredController
from stiction_ros.identification.closed_loop.repeated_runs import controllers_of, period_of
from stiction_ros.identification.closed_loop.scaled_loop import (
    ScaledLoop,
    free_run,
    scaled,
    scaled_process,
)
from stiction_ros.identification.result.identification import (
    FitStatus,
    Identification,
    ValveEstimate,
)
from stiction_ros.loop.set_points import holds
from stiction_ros.records.record import Record

MOST = 4000
"""Samples that are run again, the last ones: hundreds of cycles say no more."""

UNSEEN_CYCLES = 10
"""Cycles that a record without an oscillation is taken to have room for."""


@dataclasses.dataclass(frozen=True)
class RecordedLoop:
    """One valve in its loop; signals scaled, rows those that are run again.

    Attributes:
        record: what was measured.
        estimates: of all valves.
        loop: the scaled signals.
        process: equation (9).
        pairs: per valve the output of its controller, −1 for none, and the controller.
        valve, output: indices of what is looked at.
        rows: first row that is run, and the one behind the last.
        simulated: PV of the process driven by the estimated stems, shape (N, p).
        yardstick: measures of a run.
    """

    record: Record
    estimates: tuple[ValveEstimate, ...]
    loop: ScaledLoop
    process: Process
    pairs: tuple[tuple[int, RecoveredController], ...]
    valve: int
    output: int
    rows: tuple[int, int]
    simulated: FloatArray
    yardstick: Yardstick

    @classmethod
    def of(cls, record: Record, found: Identification, valve: str | None = None) -> RecordedLoop:
        """Return the loop of a valve; of the one with the widest band when none is named.

        Raises:
            InputError: no model, no such valve, or no controller that explains OP.
        """
        if found.status is not FitStatus.OK:
            raise InputError(f"there is no model to simulate: {found.reason}", where=record.name)
        loop = scaled(record, found.stem)
        if loop is None:
            raise InputError("OP or PV does not move in automatic", where=record.name)
        chosen = _chosen(found, valve, record)
        swings = [oscillation(loop.op[:, j], loop.stretches) for j in range(len(record.valves))]
        periods = [period_of(swing, loop, UNSEEN_CYCLES) for swing in swings]
        pairs = tuple(paired(loop, periods))
        output, law = pairs[chosen]
        if output < 0:
            raise InputError(
                f"no controller of {record.valves[chosen]} can be recovered: {law.reason}",
                where=record.name,
                fix="give a record in automatic, with SP and OP not rounded away",
            )
        process = scaled_process(found.outputs, record.valves, loop)
        first, last = loop.longest
        past = _past(process, pairs)
        first = max(first, last - MOST - past)
        simulated = free_run(process, loop, loop.stem)
        if not np.isfinite(simulated[first:last]).all():
            raise InputError("the identified process grows without end", where=record.name)
        period = cycle_period(output_oscillation(loop, output))
        rows = slice(first + past, last)
        moves = law.set_point[rows, None]
        stretches = holds(moves)
        if period is not None and max(b - a for a, b in stretches) < 2.0 * period:
            stretches = [(0, len(moves))]
        yardstick = Yardstick(record.sample_time, period, stretches)
        return cls(
            record=record,
            estimates=found.valves,
            loop=loop,
            process=process,
            pairs=pairs,
            valve=chosen,
            output=output,
            rows=(first + past, last),
            simulated=simulated,
            yardstick=yardstick,
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
    def past(self) -> int:
        """H, samples before the first of a run."""
        return _past(self.process, self.pairs)

    @property
    def load(self) -> FloatArray:
        """What the process leaves of PV in the rows and the past before them, shape (H + n, p)."""
        whole = slice(self.rows[0] - self.past, self.rows[1])
        return np.asarray(self.loop.pv[whole] - self.simulated[whole])

    @property
    def set_points(self) -> FloatArray:
        """Set-points in the rows and the past before them, recorded or found, (H + n, p)."""
        whole = slice(self.rows[0] - self.past, self.rows[1])
        if self.loop.sp is None:
            sp = np.zeros((whole.stop - whole.start, self.loop.pv.shape[1]))
        else:
            sp = self.loop.sp[whole].copy()
        for i, law in self.pairs:
            if i >= 0:
                sp[:, i] = law.set_point[whole]
        return sp

    def now(self) -> Measures:
        """Return the measures of the record itself."""
        rows = slice(*self.rows)
        error = self.loop.pv[rows, self.output] - self.law.set_point[rows]
        stem = self.loop.stem[rows, self.valve]
        return self.yardstick.measure(self.pv_scale * error, self.op_scale * stem)

    def last(self, samples: int, past: int) -> RecordedLoop:
        """Return the loop with no more than its last ``samples`` rows.

        Args:
            samples: rows that are kept, at most.
            past: rows of the longest stretch that are before them, as far as a third of it goes.
        """
        first, last = self.loop.longest
        ahead = first + min(past, (last - first) // 3)
        return self._from(max(self.rows[0], last - samples, ahead))

    def with_process(self, gain: float, dead_time: float) -> RecordedLoop:
        """Return the loop with another process; what that leaves of PV is its load.

        So it repeats the record as well. Rows that it has no past for are left out.

        Args:
            gain: factor on what the valve does.
            dead_time: factor on its dead time; other than 1 it makes a sample at least, as far as
                there is any.
        """
        process = self.process
        i, j = self.output, self.valve
        b, delay = process.b.copy(), process.delay.copy()
        b[i, j] *= gain
        known = int(delay[i, j])
        change = max(round(abs(dead_time - 1.0) * known), 1) if dead_time != 1.0 else 0
        delay[i, j] = max(known + (change if dead_time > 1.0 else -change), 0)
        process = process._replace(b=b, delay=delay)
        simulated = free_run(process, self.loop, self.loop.stem)
        other = dataclasses.replace(self, process=process, simulated=simulated)
        return other._from(max(self.rows[0], other.past))

    def _from(self, row: int) -> RecordedLoop:
        """Return the loop from a row on."""
        ahead = row - self.rows[0]
        stretches = [(max(a - ahead, 0), b - ahead) for a, b in self.yardstick.stretches]
        yardstick = dataclasses.replace(
            self.yardstick, stretches=[(a, b) for a, b in stretches if b > 0]
        )
        return dataclasses.replace(self, rows=(row, self.rows[1]), yardstick=yardstick)

    def run(self, frictions: FloatArray, tunings: FloatArray) -> list[Measures | None]:
        """Return the measures of the loop with another friction or tuning of the valve.

        Args:
            frictions: (f_S, f_D) of the valve, %, shape (R, 2).
            tunings: (K, K_i, K_d) of its controller, scaled, shape (R, 3).

        Returns:
            None for a run that grows without end.
        """
        number, past, j, i = len(frictions), self.past, self.valve, self.output
        before = slice(self.rows[0] - past, self.rows[0])
        friction = np.empty((number, len(self.estimates), 2))
        tuning = np.empty((number, len(self.estimates), 3))
        for v, valve in enumerate(self.estimates):
            pair = np.array([valve.static_friction, valve.dynamic_friction])
            friction[:, v] = pair / self.loop.op_scale[v]
            tuning[:, v] = self.pairs[v][1].coefficients
        friction[:, j], tuning[:, j] = frictions / self.op_scale, tunings
        runs = Runs(
            friction,
            tuning,
            np.repeat(self.simulated[before].T[None], number, axis=0),
            np.repeat(self.loop.stem[before].T[None], number, axis=0),
            np.repeat(self.loop.op[self.rows[0] - 1][None], number, axis=0),
        )
        sp = np.repeat(self.set_points[None], number, axis=0)
        load = np.repeat(self.load[None], number, axis=0)
        op, pv = run_loops(self.process, controllers_of(self.pairs), runs, sp, load)
        start = np.full(number, self.loop.stem[self.rows[0] - 1, j])
        stem = stems_of(np.ascontiguousarray(op[:, :, j]), friction[:, j].copy(), start)
        errors = pv[:, :, i] - sp[:, past:, i]
        return [
            self.yardstick.measure(self.pv_scale * error, self.op_scale * moved)
            if np.isfinite(error).all()
            else None
            for error, moved in zip(errors, stem, strict=True)
        ]


def _past(process: Process, pairs: tuple[tuple[int, RecoveredController], ...]) -> int:
    late = max(law.lag for _, law in pairs)
    return int(max(process.a.shape[1], process.b.shape[2] + int(process.delay.max()) + 1, 4 + late))


def _chosen(found: Identification, name: str | None, record: Record) -> int:
    if name is None:
        shares = [valve.band_share for valve in found.valves]
        return int(np.argmax(shares))
    if name not in record.valves:
        raise InputError(f"no valve {name!r}", where="--valve", fix=", ".join(record.valves))
    return record.valves.index(name)
