"""The loop of a seed run again: another valve, another tuning, another controller."""

import dataclasses
from collections.abc import Callable

import numpy as np

from stiction_studies.field import kernels
from stiction_studies.field.circumstances import UNITS, Circumstances, draw_circumstances
from stiction_studies.field.drawing import Made
from stiction_studies.field.field_loop import FieldLoop, drawn
from stiction_studies.field.historian import IndexArray
from stiction_studies.field.kernels import FloatArray
from stiction_studies.field.simulation import Loop, Signals, run

# PV, SP and the OP of the sample before, in the units of the record, to the OP from now on
Control = Callable[[float, float, float], float]
# PV and OP of the samples so far, shape (K,), in the units of the record, to the controller
TakeOver = Callable[[FloatArray, FloatArray], Control]
PAST = 1000  # samples that another controller may take over, at most


@dataclasses.dataclass(frozen=True)
class Sampled:
    """What happened at the samples of a record, in its units, shape (N,) each.

    Attributes:
        error: PV as the controller reads it, less SP.
        stem: position of the stem.
    """

    error: FloatArray
    stem: FloatArray


@dataclasses.dataclass(frozen=True)
class Again:
    """A loop of the field that can be run again under the same loads, noise and set-points.

    Attributes:
        loop: as it was recorded.
        made: what it is made of.
        samples: sample of the run at each row of the record, shape (N,).
        factor, offset: from % to the record's unit of OP.
    """

    loop: FieldLoop
    made: Made
    samples: IndexArray
    factor: float
    offset: float

    @classmethod
    def of(cls, seed: int) -> "Again":
        """Return the loop of a seed."""
        circumstances: Circumstances = draw_circumstances(np.random.default_rng([seed, 0]))
        made, loop = drawn(seed)
        record = loop.record
        samples = np.rint(record.time / record.sample_time).astype(np.intp)
        factor, offset = UNITS[circumstances.unit]
        out = run(made.loop, made.signals)
        stem = factor * out.stem[made.warm :: made.loop.clock.sample]
        offset = float(np.median(loop.stem[:, 0] - stem[samples]))  # a centred OP has its own
        return cls(loop, made, samples, factor, offset)

    def as_recorded(self) -> Sampled:
        """Return the run that was recorded."""
        return self._run(self.made.loop)

    def serviced(self) -> Sampled:
        """Return the run with a valve that nothing holds."""
        valve = self.made.loop.valve.without_friction()
        return self._run(dataclasses.replace(self.made.loop, valve=valve))

    def retuned(self, gain: float, integral: float) -> Sampled:
        """Return the run with factors on the controller's gain and integral time."""
        law = self.made.loop.controller
        law = dataclasses.replace(law.scaled(gain), integral=law.integral * integral)
        return self._run(dataclasses.replace(self.made.loop, controller=law))

    def controlled(self, take_over: TakeOver, after: int = 0) -> Sampled:
        """Return the run in which another controller moves OP at the samples of the record.

        Args:
            take_over: makes it from what has been so far.
            after: row of the record from which on it acts; the loop's own controller does before.
        """
        loop, signals, clock = self.made.loop, self.made.signals, self.made.loop.clock
        begun = self.made.warm + int(self.samples[after]) * clock.sample
        before = run(loop, _until(signals, begun))
        state, stems, op = before.state, before.stem, float(before.op[-1])
        so_far = slice(max(begun - PAST * clock.sample, begun % clock.sample), begun, clock.sample)
        control = take_over(before.pv[so_far].copy(), self.factor * before.op[so_far] + self.offset)
        dead = round(loop.process.dead_time / clock.step)
        waiting = np.full(dead + 1, stems[-1])
        known = stems[-(dead + 1) :]
        for k in range(begun - len(known), begun):
            waiting[k % (dead + 1)] = known[k - begun]
        cycle = max(1, round(loop.process.cycle / clock.step))
        stem_state = loop.valve.rest(float(stems[-1]))
        clean = float(kernels.plant_output(loop.process.code, state))
        shown = float(before.pv[-1])
        done = slice(self.made.warm, begun, clock.sample)
        errors = (before.pv - signals.set_point[:begun])[done].tolist()
        positions = (self.factor * stems[done] + self.offset).tolist()
        last = self.factor * op + self.offset
        for k in range(begun, len(signals.load), clock.sample):
            due = k - k % cycle
            if due > k - clock.sample or cycle == 1:
                shown = clean + float(signals.noise[k])
            goal = float(signals.set_point[k])
            last = control(shown, goal, last)
            op = min(max((last - self.offset) / self.factor, 0.0), 100.0)
            last = self.factor * op + self.offset
            stem, clean = kernels.run_held(
                (loop.valve.law.value, loop.valve.parameters(), stem_state),
                (loop.process.code, loop.process.parameters, state),
                (clock.step, k),
                waiting,
                op,
                np.ascontiguousarray(signals.load[k : k + clock.sample]),
            )
            errors.append(shown - goal)
            positions.append(self.factor * stem + self.offset)
        return Sampled(np.array(errors)[self.samples], np.array(positions)[self.samples])

    def _run(self, loop: Loop) -> Sampled:
        out = run(loop, self.made.signals)
        sampled = slice(self.made.warm, None, loop.clock.sample)
        error = (out.pv - self.made.signals.set_point)[sampled][self.samples]
        return Sampled(error, self.factor * out.stem[sampled][self.samples] + self.offset)


def _until(signals: Signals, count: int) -> Signals:
    """Return the first steps of signals."""
    return Signals(*(getattr(signals, part.name)[:count] for part in dataclasses.fields(signals)))
