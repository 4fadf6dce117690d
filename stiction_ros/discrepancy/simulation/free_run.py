"""The free run: a loop model driven by the recorded OP of one or more records."""

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from stiction_ros.discrepancy.likelihood.declared_noise import Unseen
from stiction_ros.discrepancy.likelihood.noise import MAX_ORDER, Blocks
from stiction_ros.discrepancy.measures import PROBE
from stiction_ros.discrepancy.simulation.between import left_open
from stiction_ros.discrepancy.simulation.responses import Responses, end_to_end, responses_of
from stiction_ros.effects import Behaviour, FloatArray, Seen
from stiction_ros.effects.behaviour import BoolArray
from stiction_ros.effects.disturbance.periodic import PeriodicDisturbance
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.processes import Process
from stiction_ros.records import Record

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

HELD_SHARE = 4
BLOCKS = 24
PHASES = (0, 1, 3)
"""Of the held-out blocks, record by record. By each of them the first block of a record is fitted:
nothing else holds its state at the start."""
FEWEST = 40  # samples of the longest record


@dataclasses.dataclass(frozen=True)
class Runs:
    """Records of one loop laid end to end; nothing reaches from one into the next."""

    records: tuple[Record, ...]  # at least one, of one loop
    op: FloatArray  # shape (N, m), %, within the limits of the valves
    pv: FloatArray  # shape (N, p)
    time: FloatArray  # seconds since the first sample of the own record, shape (N,)
    slices: tuple[slice, ...]  # rows of each record
    usable: BoolArray  # per output the rows whose PV can be scored, shape (p, N)
    quanta: tuple[float, ...]  # per output the step of a coarse rounding; 0 where there is none
    # per output the rows whose PV a historian filled in between the values that it kept, shape (p,
    # N)
    filled: BoolArray
    # per output the distance of PV's values, however fine; 0 where there is none
    lattices: tuple[float, ...]
    alone: tuple[int, ...]  # per output, how many readings that are off alone were left out
    # per valve what may act beside the recorded OP; empty where nothing does
    unseen: tuple[tuple[Unseen, ...], ...] = ()
    # per valve whether it is left open how late within a sample an effect that is added moves its
    # stem; empty where that is not asked
    between: tuple[bool, ...] = ()
    # OP at the two scans of each sample, shape (2 N, m), %; a stem slips by either. None where a
    # sample holds one OP
    scans: FloatArray | None = None
    # of the blocks of each record that are kept back, each of ``PHASES``; by turns where none are
    # given
    phases: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if not self.phases:
            phases = tuple(PHASES[r % len(PHASES)] for r in range(len(self.slices)))
            object.__setattr__(self, "phases", phases)

    @property
    def thinned(self) -> tuple[float, ...]:
        """Per output the share of values that were filled in; their noise is not the loop's."""
        return tuple(
            float(np.mean(filled[usable | filled])) if filled.any() else 0.0
            for usable, filled in zip(self.usable, self.filled, strict=True)
        )

    @property
    def scanned(self) -> int:
        """Scans of a sample, each of which holds an OP of its own."""
        return 1 if self.scans is None else 2

    def kept_back(self, record: int, phase: int) -> BoolArray:
        """Return which rows of one record are kept back, shape (n,)."""
        rows = self.slices[record]
        place = np.arange(rows.stop - rows.start) // self.block + phase
        return np.asarray(place % HELD_SHARE == HELD_SHARE - 2)

    @property
    def block(self) -> int:
        """Samples that are kept back, or drawn again, together."""
        return max(len(self) // BLOCKS, FEWEST // 2)

    def at_scans(self, rows: slice) -> slice:
        """Return where the scans of some rows are."""
        return slice(self.scanned * rows.start, self.scanned * rows.stop)

    @property
    def stems_recorded(self) -> bool:
        """Whether a record has the positions of its stems."""
        return any(record.stem is not None for record in self.records)

    def stem(self, valve: str) -> FloatArray:
        """Return the recorded positions of a stem, shape (N,), %; NaN in records without."""
        parts = [
            np.full(len(r), np.nan) if r.stem is None else r.stem[:, r.valves.index(valve)]
            for r in self.records
        ]
        return np.concatenate(parts)

    @property
    def sample_time(self) -> float:
        """Seconds between two samples."""
        return self.records[0].sample_time

    @property
    def longest(self) -> slice:
        """Rows of the longest record."""
        return max(self.slices, key=lambda rows: rows.stop - rows.start)

    def __len__(self) -> int:
        return len(self.op)


def join_records(model: LoopModel, records: Sequence[Record]) -> Runs:
    """Return the records end to end, signals in the order of the model.

    Raises:
        InputError: no record, other tags or another sample time than the model's.
    """
    if not records:
        raise InputError("no record", where=model.name, fix="give one record at least")
    for record in records:
        _check(model, record)
    if (longest := max(map(len, records))) < FEWEST:
        raise InputError(
            f"{longest} samples are too few, {FEWEST} are needed",
            where=records[0].name,
            fix="take a longer record",
        )
    op = np.vstack([r.op[:, [r.valves.index(v) for v in model.valve_names]] for r in records])
    pv = np.vstack([r.pv[:, [r.outputs.index(o) for o in model.outputs]] for r in records])
    ends = np.cumsum([len(r) for r in records]).tolist()
    slices = tuple(slice(end - len(r), end) for r, end in zip(records, ends, strict=True))
    usable = np.ones((pv.shape[1], len(pv)), dtype=bool)
    low, high = model.limits.T
    time = np.concatenate([r.time for r in records])
    op = np.clip(op, low, high)
    none = (0.0,) * pv.shape[1]
    filled = np.zeros_like(usable)
    return Runs(tuple(records), op, pv, time, slices, usable, none, filled, none, (0,) * len(none))


def _check(model: LoopModel, record: Record) -> None:
    for what, wanted, found in (
        ("valve", model.valve_names, record.valves),
        ("output", model.outputs, record.outputs),
    ):
        for name in wanted:
            if name not in found:
                raise InputError(
                    f"has no {what} {name!r}",
                    where=record.name,
                    fix=f"it has {', '.join(found)}; choose columns with --op and --pv",
                )
    if abs(record.sample_time - model.sample_time) > 1e-3 * model.sample_time:
        raise InputError(
            f"is sampled every {record.sample_time:g} s, the model every {model.sample_time:g} s",
            where=record.name,
            fix="fit a model to this sample time",
        )


class FreeRun:
    """The current model under the recorded OP, and what small changes of it would give.

    The state at the start, and a constant, of every record are left open: they are columns
    that every fit projects out. So is how late within a sample a sticky or slow stem moves: OP and
    PV are held to samples, the stem is not; and what it does that the scans of a sample differ,
    whose mean alone the model of the process knows.

    Attributes:
        model, runs: what runs, over what.
        leads: of valves whose last effect starts with its stem that far from OP, %.
        scanned: positions of the current model at every scan, shape (scans N, m), %.
        stems: their means over each sample, shape (N, m), %.
        loads: what enters the process beside them, shape (N, m), %.
        forced: outputs of the process, shape (N, p), but for the free columns.
        known: what disturbances and sensors of the current model add, shape (N, p).
        free: per output the free columns, shape (N, q).
        beyond: per output and valve what a lag does beyond the samples, by the logarithm of its
            time constant; laid when it is first asked.
    """

    def __init__(
        self, model: LoopModel, runs: Runs, leads: Mapping[str, float] | None = None
    ) -> None:
        """Run the model once.

        Args:
            model: what runs.
            runs: over what.
            leads: of valves whose last effect starts with its stem that far from OP, %.

        Raises:
            InputError: the model's free run is not finite.
        """
        self.model, self.runs = model, runs
        self.leads, self.beyond = dict(leads or {}), dict[tuple[int, int | None], "CubicSpline"]()
        self.responses: Responses = responses_of(model.process, model.sample_time)
        self.scanned = np.column_stack(
            [self.valve_chain(j, valve.effects) for j, valve in enumerate(model.valves)]
        )
        self.stems = over_samples(self.scanned, runs)
        self.loads = self._loads()
        self.forced = np.column_stack([self.drive(i)[:, 0] for i in range(len(model.outputs))])
        self.known = np.column_stack([self._known(i) for i in range(len(model.outputs))])
        self.free = [self._free(i) for i in range(len(model.outputs))]
        if not (np.isfinite(self.forced).all() and all(np.isfinite(f).all() for f in self.free)):
            raise InputError(
                "its free run grows without bound", where=model.name, fix="use a stable model"
            )

    @property
    def gap(self) -> FloatArray:
        """PV less the free run, shape (N, p), free columns not yet taken out."""
        return np.asarray(self.runs.pv - self.forced - self.known)

    def gap_behind(self, process: Process, output: int) -> FloatArray:
        """Return PV of one output less what another process makes of the same stems, shape (N,)."""
        other = copy.copy(self)
        other.responses = responses_of(process, self.model.sample_time)
        other.forced = self.forced.copy()
        other.forced[:, output] = other.drive(output)[:, 0]
        return np.asarray(self.runs.pv[:, output] - other.forced[:, output] - other._known(output))

    def blocks(self, output: int) -> Blocks:
        """Return the rows that are fitted and those kept back, interleaved."""
        first = np.zeros(len(self.runs), dtype=bool)
        for rows in self.runs.slices:
            first[rows.start : rows.start + self.responses.skip + MAX_ORDER] = True
        usable = _with_past(self.runs.usable[output]) & ~first
        kept = np.concatenate(
            [self.runs.kept_back(r, phase) for r, phase in enumerate(self.runs.phases)]
        )
        return Blocks(usable & ~kept, usable & kept, 1.0 - self.runs.thinned[output])

    def drive(
        self, output: int, valve: int | None = None, stems: FloatArray | None = None
    ) -> FloatArray:
        """Return one output, shape (N, G), with the stems of one valve replaced.

        Args:
            output: its index.
            valve: whose stems are replaced; None keeps all.
            stems: shape (N, G), %, without what enters beside them.
        """
        parts = []
        for rows in self.runs.slices:
            inputs = self.inputs(rows)
            if valve is not None and stems is not None:
                inputs[valve] = stems[rows] + self.loads[rows, valve, None]
            parts.append(self.responses.forced(output, inputs))
        return end_to_end(parts)

    def valve_chain(self, valve: int, effects: Sequence[Behaviour]) -> FloatArray:
        """Return the stem of one valve at every scan, %, moved by OP."""
        low, high = self.model.limits[valve]
        runs = self.runs
        stem = (runs.op if runs.scans is None else runs.scans)[:, valve].copy()
        lead = self.leads.get(self.model.valves[valve].name, 0.0)
        for rows in map(runs.at_scans, runs.slices):
            for k, effect in enumerate(effects):
                first = float(stem[rows.start]) + (lead if k == len(effects) - 1 else 0.0)
                stem[rows] = effect.simulate(stem[rows], first, runs.sample_time / runs.scanned)
        return np.asarray(np.clip(stem, low, high))

    def _free(self, output: int) -> FloatArray:
        blocks = [self.responses.free(output, self.inputs(rows)) for rows in self.runs.slices]
        within = [
            self._within(output, j)
            for j in range(len(self.model.valves))
            if self.runs.scans is not None and self.responses.reaches(output, j)
        ]
        return np.column_stack([block_diag(*blocks), *left_open(self, output), *within])

    def _within(self, output: int, valve: int) -> FloatArray:
        """Return the answers to what the first scan of a sample is above the second, shape (N, 2).

        Now and a sample late: together they hold what any process of two lags does.
        """
        first, second = self.scanned[:, valve].reshape(len(self.runs), -1).T
        above = np.zeros((len(self.runs), 2))
        for rows in self.runs.slices:
            above[rows, 0] = first[rows] - second[rows]
            above[rows][1:, 1] = above[rows][:-1, 0]
        return self.slope(output, valve, above)

    def slope(self, output: int, valve: int, moves: FloatArray) -> FloatArray:
        """Return what small moves of a stem, shape (N, G), %, do to an output, per %."""
        moved = self.drive(output, valve, self.stems[:, valve, None] + PROBE * moves)
        return np.asarray((moved - self.forced[:, output, None]) / PROBE)

    def inputs(self, rows: slice) -> list[FloatArray]:
        """Return what enters the process in one record, per valve, each of shape (N, 1)."""
        entering = self.stems[rows] + self.loads[rows]
        return [entering[:, j : j + 1] for j in range(entering.shape[1])]

    def _loads(self) -> FloatArray:
        loads = np.zeros_like(self.stems)
        names = self.model.valve_names
        for disturbance in self.model.disturbances:
            if not disturbance.load:
                continue
            for rows in self.runs.slices:
                loads[rows, names.index(disturbance.place)] += _entering(
                    disturbance.behaviour, rows.stop - rows.start, self.runs.sample_time
                )
        return loads

    def _known(self, output: int) -> FloatArray:
        name = self.model.outputs[output]
        added = np.zeros(len(self.runs))
        for rows in self.runs.slices:
            zeros = np.zeros(rows.stop - rows.start)
            for disturbance in self.model.disturbances:
                if disturbance.load:
                    continue
                wave = disturbance.behaviour.simulate(zeros, 0.0, self.runs.sample_time)
                if disturbance.place == name:
                    added[rows] += wave
                elif disturbance.place not in self.model.outputs:
                    response = self.responses.load(output, disturbance.place, wave[:, None])
                    added[rows] += 0.0 if response is None else response[:, 0]
            added[rows] += self._sensed(output, self.forced[rows, output] + added[rows])
        return added

    def _sensed(self, output: int, values: FloatArray) -> FloatArray:
        """Return what the sensor's linear and additive effects change, shape (N,).

        Frozen, clipped and rounded values are left out of scoring or count as noise.
        """
        shown = values
        for effect in self.model.sensors[output]:
            if not effect.in_values:
                shown = effect.simulate(shown, float(shown[0]), self.runs.sample_time)
        return np.asarray(shown - values)


def over_samples(values: FloatArray, runs: Runs) -> FloatArray:
    """Return the means over each sample, shape (N, G), of values at every scan."""
    if runs.scans is None:
        return values
    return np.asarray(values.reshape(len(runs), runs.scanned, -1).mean(axis=1))


def _entering(load: Behaviour, count: int, sample_time: float) -> FloatArray:
    """Return what a load adds to a stem in each sample: of a wave, which goes on, its mean."""
    if isinstance(load, PeriodicDisturbance):
        return load.entering(np.asarray(sample_time * np.arange(count)), sample_time)
    return load.simulate(np.zeros(count), 0.0, sample_time)


def seen_of(run: FreeRun, signal: FloatArray) -> Seen:
    """Return what is told of a signal, shape (N,), to whoever says what is to be searched."""
    moves = np.concatenate([np.diff(signal[rows]) for rows in run.runs.slices])
    fastest = float(np.abs(moves).max(initial=0.0)) / run.runs.sample_time
    return Seen(signal, fastest, run.runs.sample_time)


def _with_past(usable: BoolArray) -> BoolArray:
    """Return the usable rows whose noise can be foretold: the rows before them are usable too."""
    found = usable.copy()
    for lag in range(1, MAX_ORDER + 1):
        found[lag:] &= usable[:-lag]
    return found
