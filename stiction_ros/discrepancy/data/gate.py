"""Step 1, the gate: what is wrong with the data, and what it can show at all."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.data.filled import drawn, held
from stiction_ros.discrepancy.likelihood.noise import MAX_ORDER
from stiction_ros.discrepancy.measures import MAJORITY, NEGLIGIBLE, OFTEN
from stiction_ros.discrepancy.simulation.free_run import Runs, join_records
from stiction_ros.effects import Behaviour, Clip, FloatArray, Freeze, Quantisation
from stiction_ros.effects.behaviour import BoolArray, IntArray
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record
from stiction_ros.records.valve_work import ValveWork
from stiction_ros.signals.autoregression import best_autoregression, whiten
from stiction_ros.signals.holds import stretches

SHOWN = (Freeze, Clip, Quantisation)
"""What is looked for here."""
COARSE = 1.8  # innovations of PV in quanta, below which a quantum is worth a finding


@dataclasses.dataclass(frozen=True)
class DataFinding:
    """An effect that the recorded values themselves show."""

    place: str  # as loop models name it
    behaviour: Behaviour  # with its figures
    delta_bic: float  # by how much shorter the values are told with it
    record: int = 0  # index of the record

    @property
    def effect(self) -> str:
        """Name of the effect in a loop model."""
        return self.behaviour.effect


@dataclasses.dataclass(frozen=True)
class Gate:
    """Findings in the records, before anything is compared with the model."""

    # frozen, clipped and rounded PVs, but for what the model has already
    findings: tuple[DataFinding, ...]
    # per output, over all records; None where SP is not recorded
    set_point_moves: tuple[int, ...] | None
    reversals: tuple[int, ...]  # of OP per valve
    notes: tuple[str, ...]  # remarks for people


def open_gate(model: LoopModel, records: Sequence[Record]) -> tuple[Runs, Gate]:
    """Return the records end to end, what of their PV is measured, and what the values show.

    Raises:
        InputError: as :func:`join_records`.
    """
    runs = join_records(model, records)
    usable = np.ones((len(model.outputs), len(runs)), dtype=bool)
    filled = np.zeros_like(usable)
    findings: list[DataFinding] = []
    quanta, rounding, notes = [], [], []
    for i, name in enumerate(model.outputs):
        quantum = quantum_of(runs.pv[:, i])
        quanta.append(quantum)
        rounded = _rounded(runs, i, name, quantum)
        for r, rows in enumerate(runs.slices):
            values = runs.pv[rows, i]
            if not rounded:  # values on a coarse lattice rest, and meet at its ends, anyway
                rests = _Rests.of(values)
                frozen = _frozen(values, rests, name, r, runs.sample_time)
                clipped = _clipped(values, rests, name, r, quantum)
                for finding, where in (*frozen, *clipped):
                    usable[i, rows] &= ~where
                    findings.append(finding)
            if rounded:
                continue
            lines, again = drawn(values, quantum), held(values, quantum, usable[i, rows])
            filled[i, rows] = lines | again
            for found, does in ((lines, "lies on straight lines"), (again, "repeats itself")):
                if found.any():
                    notes.append(
                        f"{name} {does}: a historian has thinned it out, small effects are lost"
                    )
        findings += rounded
        rounding.append(quantum if rounded else 0.0)
    findings = [finding for finding in findings if not known_already(model, runs, finding)]
    for i, name in enumerate(model.outputs):
        if np.ptp(runs.pv[:, i]) == 0.0:
            notes.append(f"{name} never moves: whatever OP does, it shows nothing")
    for j, valve in enumerate(model.valve_names):
        if np.ptp(runs.op[:, j]) == 0.0:
            notes.append(f"OP of {valve} never moves: nothing can be said of that valve")
    seen = dataclasses.replace(
        runs, usable=usable, quanta=tuple(rounding), filled=filled, lattices=tuple(quanta)
    )
    return seen, Gate(
        tuple(findings),
        _moves(model, runs),
        tuple(_reversals(runs, op) for op in runs.op.T),
        tuple(dict.fromkeys(notes)),
    )


def known_already(model: LoopModel, runs: Runs, finding: DataFinding) -> bool:
    """Tell whether the model has an effect that shows what a finding says.

    That is one of the same kind whose figures are the same as far as the values tell: a quantum
    to a hundredth, a rest within two samples, and the ends that the values meet.
    """
    output = model.outputs.index(finding.place.partition(":")[2])
    values = runs.pv[runs.slices[finding.record], output]
    return any(
        type(effect) is type(finding.behaviour)
        and _same(effect, finding.behaviour, values, runs.sample_time)
        for effect in model.sensors[output]
    )


def _same(known: Behaviour, found: Behaviour, values: FloatArray, sample_time: float) -> bool:
    if isinstance(known, Quantisation) and isinstance(found, Quantisation):
        return abs(known.quantum - found.quantum) <= NEGLIGIBLE * found.quantum
    if isinstance(known, Freeze) and isinstance(found, Freeze):
        begins = abs(known.onset - found.onset) <= 2.0 * sample_time
        ends = known.onset + known.duration - found.onset - found.duration
        return begins and abs(ends) <= 2.0 * sample_time
    if isinstance(known, Clip) and isinstance(found, Clip):
        width = NEGLIGIBLE * max(float(np.ptp(values)), 1e-300)
        pairs = ((known.low, found.low), (known.high, found.high))
        met = [(mine, seen) for mine, seen in pairs if values.min() <= seen <= values.max()]
        return all(abs(mine - seen) <= width for mine, seen in met)
    return False


def quantum_of(values: FloatArray) -> float:
    """Return the distance of the values; 0 where there is none above the digits of a float."""
    distinct = np.unique(values)
    if len(distinct) < 2:
        return 0.0
    steps = np.diff(distinct)
    smallest = float(steps.min())
    if smallest <= 1e-7 * max(float(np.abs(distinct).max()), 1e-300):
        return 0.0
    ratio = steps / smallest
    if float(np.abs(ratio - np.rint(ratio)).max()) > 1e-3 * float(ratio.max()) ** 0.5:
        return 0.0
    return smallest


@dataclasses.dataclass(frozen=True)
class _Rests:
    """Where the values of a record rest."""

    first: IntArray  # first, last: sample of each rest, shape (R,)
    last: IntArray
    count: int  # N, of the record

    @classmethod
    def of(cls, values: FloatArray) -> "_Rests":
        return cls(*stretches(np.diff(values) == 0.0), len(values))

    @property
    def repeats(self) -> IntArray:
        """How often each repeats its value, shape (R,)."""
        return self.last - self.first

    @property
    def share(self) -> float:
        """Share of the samples that repeat the one before, but for the longest rest."""
        longest = int(self.repeats.max(initial=0))
        others = int(self.repeats.sum()) - longest
        return min(others / max(self.count - longest, 1), 0.99)

    @property
    def by_no_chance(self) -> float:
        """How often a value is repeated that rests longer than by chance."""
        share = self.share
        natural = math.log(max(self.count, 3)) / math.log(1.0 / share) if share > 0.0 else 0.0
        return OFTEN + 3.0 * natural


def _frozen(
    values: FloatArray, rests: _Rests, name: str, record: int, sample_time: float
) -> list[tuple[DataFinding, BoolArray]]:
    """Return each rest of PV that is too long for its noise, with its rows."""
    if not len(rests.first):
        return []
    longest = int(np.argmax(rests.repeats))
    first, last = int(rests.first[longest]), int(rests.last[longest])
    # What stands at the end of all values is an end of the sensor's range, unless it leaps there.
    at_an_end = values[last] in (values.min(), values.max())
    if last - first < rests.by_no_chance or (at_an_end and not _leaps(values, first, last)):
        return []
    where = np.zeros(len(values), dtype=bool)
    where[first + 1 : last + 1] = True
    behaviour = Freeze(float((first + 1) * sample_time), float((last - first) * sample_time))
    share = max(rests.share, 1.0 / len(values))
    gain = 2.0 * (last - first) * math.log(1.0 / share) - 2.0 * math.log(len(values))
    return [(DataFinding(f"sensor:{name}", behaviour, gain, record), where)]


def _leaps(values: FloatArray, first: int, last: int) -> bool:
    """Tell whether values leap to what stands from ``first`` to ``last``, or from there.

    They move farther there than anywhere else. A measurement goes to the end of its range, and
    comes back, by and by; one that was frozen is at once where it would have been.
    """
    steps = np.abs(np.diff(values))
    at = [k for k in (first - 1, last) if 0 <= k < len(steps)]
    return bool(at) and float(steps[at].max()) > np.delete(steps, at).max(initial=0.0)


def _clipped(
    values: FloatArray, rests: _Rests, name: str, record: int, quantum: float
) -> list[tuple[DataFinding, BoolArray]]:
    """Return the ends of the range at which PV stands again and again, with their rows."""
    low, high = float(values.min()), float(values.max())
    if low == high:
        return []
    at_low, at_high = values == low, values == high
    limits = [low, high]
    where = np.zeros(len(values), dtype=bool)
    gain, ends = 0.0, 0
    for k, at in enumerate((at_low, at_high)):
        count = int(at.sum())
        beside = 0
        if quantum:
            beside = int((np.abs(values - limits[k] - (1 - 2 * k) * quantum) < 0.5 * quantum).sum())
        begins, behind = stretches(at)
        stands = len(begins) > 1 or (  # one that leaps was frozen
            count >= rests.by_no_chance and not _leaps(values, begins[0], behind[0] - 1)
        )
        if count >= OFTEN and stands and count > 3 * beside:
            where |= at
            ends += 1
            gain += 2.0 * count * math.log(len(values) / 10.0)
        else:
            limits[k] += (2 * k - 1) * 10.0 * (high - low)  # beyond what was seen
    if not ends or int(where.sum()) > MAJORITY * len(values):
        return []  # what stands at its ends more often is no clipped measurement
    gain -= ends * math.log(len(values))
    behaviour = Clip(limits[0], limits[1])
    return [(DataFinding(f"sensor:{name}", behaviour, gain, record), where)]


def _rounded(runs: Runs, output: int, name: str, quantum: float) -> list[DataFinding]:
    """Return a quantum that is coarse against what PV does not tell beforehand."""
    values = runs.pv[:, output]
    if quantum <= 0.0 or _surprise(runs, output) > COARSE * quantum:
        return []
    levels = len(np.unique(values))
    gain = 2.0 * len(values) * math.log(max(len(values) / levels, 1.0)) - math.log(len(values))
    if gain <= 0.0:
        return []
    return [DataFinding(f"sensor:{name}", Quantisation(quantum), gain)]


def _surprise(runs: Runs, output: int) -> float:
    """Return the standard deviation of PV's innovations under an autoregression of its own."""
    values = runs.pv[:, output] - runs.pv[:, output].mean()
    rows = np.ones(len(values), dtype=bool)
    for part in runs.slices:
        rows[part.start : part.start + MAX_ORDER] = False
    if not rows.any():
        return math.inf
    return float(np.std(whiten(values, best_autoregression(values, rows, MAX_ORDER)[0])[rows]))


def _moves(model: LoopModel, runs: Runs) -> tuple[int, ...] | None:
    if any(record.sp is None for record in runs.records):
        return None
    moves = np.zeros(len(model.outputs), dtype=int)
    for record in runs.records:
        assert record.sp is not None
        columns = [record.outputs.index(name) for name in model.outputs]
        moves += (np.diff(record.sp[:, columns], axis=0) != 0.0).sum(axis=0)
    return tuple(moves.tolist())


def _reversals(runs: Runs, op: FloatArray) -> int:
    return round(sum(ValveWork.of(op[rows]).reversals for rows in runs.slices))
