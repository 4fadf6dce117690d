"""The steps within which a rounded OP lies, and what they tell of the controller's law."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.discrepancy.data.gate import quantum_of
from stiction_ros.discrepancy.data.unrounded import left_out, unrounded
from stiction_ros.discrepancy.simulation.free_run import Runs
from stiction_ros.effects import FloatArray
from stiction_ros.loop import LoopModel, PiTuning

REFUTED = 0.02  # of the samples, at which no OP within its step follows a law
FACTORS = 2.0 ** np.linspace(-2.5, 2.5, 61)  # of gain and integral time, tried for another tuning


@dataclasses.dataclass(frozen=True)
class OpSteps:
    """A rounded OP of one valve, and what PI laws make their moves of.

    Attributes:
        parts: OP, %, shape (n,), and :func:`law_terms` of each record.
        quantum: distance of the recorded values, %.
        limits: at which OP is what it is recorded to be, %.
        lattice: by how much PV is rounded, in its unit.
        sample_time: s.
    """

    parts: list[tuple[FloatArray, FloatArray]]
    quantum: float
    limits: tuple[float, float]
    lattice: float
    sample_time: float

    @classmethod
    def of(cls, model: LoopModel, runs: Runs) -> OpSteps:
        """Return those of records in which SP is recorded."""
        parts = [
            (runs.op[rows, 0], law_terms(error, runs.sample_time))
            for rows, error in zip(runs.slices, errors_of(model, runs), strict=True)
        ]
        low, high = model.limits[0].tolist()
        quantum = quantum_of(runs.op[:, 0])
        return cls(parts, quantum, (low, high), float(runs.lattices[0]), runs.sample_time)

    def finer(self, tuning: PiTuning) -> FloatArray | None:
        """Return OP as a law tells it, shape (N, 1); None where it does not."""
        law, slack, found = _law(tuning), self._slack(tuning), []
        for op, terms in self.parts:
            finer = unrounded(op, terms @ law, slack, self.quantum, self.limits)
            if finer is None:
                return None
            found.append(finer)
        return np.concatenate(found)[:, None]

    def led_out(self, tuning: PiTuning) -> float:
        """Return the share of moves by which a law leaves the steps."""
        law, slack = _law(tuning), self._slack(tuning)
        out = [
            left_out(op, terms @ law, slack, self.quantum, self.limits) for op, terms in self.parts
        ]
        return sum(out) / max(sum(len(terms) for _, terms in self.parts), 1)

    def _slack(self, tuning: PiTuning) -> float:
        """Return by how much the rounding of PV moves what a law gives, %."""
        return abs(tuning.gain) * (1.0 + self.sample_time / tuning.integral_time) * self.lattice


def other_tuning(steps: OpSteps, recorded: PiTuning) -> PiTuning | None:
    """Return the tuning that was at work where the recorded one cannot have been; or None.

    Where rounding is as large as the moves of OP, squares of what is left tell little, and a gain
    that is fitted by them is too small. Each recorded OP still lies within half a step of its
    value: a law that leads out of many steps was not at work, and the tunings that lead out of the
    fewest are those that may have been. Their middle is told.

    Args:
        steps: of OP.
        recorded: the tuning that the model has.
    """
    if steps.led_out(recorded) <= REFUTED:
        return None
    gains, times = recorded.gain * FACTORS, recorded.integral_time * FACTORS
    out = np.array([[steps.led_out(PiTuning(gain, time)) for time in times] for gain in gains])
    if out.min() > REFUTED:
        return None
    best = np.nonzero(out == out.min())
    gain, time = (float(np.exp(np.log(FACTORS[index]).mean())) for index in best)
    return PiTuning(recorded.gain * gain, recorded.integral_time * time)


def errors_of(model: LoopModel, runs: Runs, shift: int = 0) -> list[FloatArray]:
    """Return SP − PV of each record, shape (n − shift,), where PV is ``shift`` samples late."""
    found = []
    for record, rows in zip(runs.records, runs.slices, strict=True):
        assert record.sp is not None
        late = runs.pv[rows, 0][shift:]
        found.append(record.sp[: len(late), record.outputs.index(model.outputs[0])] - late)
    return found


def law_terms(error: FloatArray, sample_time: float) -> FloatArray:
    """Return (e_k − e_{k−1}, T_s e_k) from the second sample on, shape (n, 2)."""
    return np.column_stack([np.diff(error), sample_time * error[1:]])


def _law(tuning: PiTuning) -> FloatArray:
    return np.array([tuning.gain, tuning.gain / tuning.integral_time])
