"""Joins the signals of a loop by stamp: runs, and records without a gap of each."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import read_messages
from stiction_ros.records.record import Quality, Record
from stiction_ros.records.run.bag_runs import run_of, tell_runs
from stiction_ros.records.run.loop_signals import Given, LoopSignals, is_signal
from stiction_ros.records.whole import Source, Whole

Samples = dict[int, dict[str, float]]  # stamp in ns to tag to value
MOST_HELD = 0.01  # share of the samples at which a missing stem is held


@dataclasses.dataclass(frozen=True)
class LoopRun:
    """One run of a loop."""

    begin: int  # begin, end: numbers of its first and last message of ``pv`` in the log
    end: int
    start: int  # stamp of its first sample, ns
    parts: tuple[Record, ...]  # its records without a gap, in order of time

    def __len__(self) -> int:
        return sum(len(part) for part in self.parts)


def loop_runs(
    signals: LoopSignals, source: Source, namespace: str | None, notes: Sequence[str]
) -> tuple[LoopRun, ...]:
    """Join what was collected of a loop to its runs, at least one, in the order of their begin.

    A stamp counts when ``pv`` and ``op`` both have it; where ``op_applied`` tells what the
    valves were given, that is taken for ``op``, and alone it will do, as where nobody but the
    plant's own controller gives an OP. ``sp`` is held from one message to the next;
    ``stem`` is dropped with a note when a stamp lacks it.

    Raises:
        InputError: no such loop; no usable message of ``pv`` or ``op``; in no run are two
            samples regular.
    """
    try:
        space = signals.loop(namespace)
    except InputError as error:
        unread = [note.removesuffix(", left out") for note in notes if "cannot be decoded" in note]
        if unread:
            what = f"{error.what} that can be read: {', '.join(unread)}"
            fix = "record it again with definitions in ros2msg, as `ros2 bag record -s mcap` does"
            raise InputError(what, where=error.where, fix=fix) from None
        raise
    loop = _Loop(signals, space, source)
    said = [*notes, *loop.notes]
    found: list[LoopRun] = []
    refused: list[InputError] = []
    for number in range(len(loop.runs)):
        try:
            found.append(loop.run(number, said))
        except InputError as error:
            refused.append(error)
    if not found:
        raise refused[0]
    if refused:
        note = f"{len(refused)} runs left out: {refused[0].what}"
        found = [
            dataclasses.replace(
                run, parts=tuple(dataclasses.replace(p, notes=(*p.notes, note)) for p in run.parts)
            )
            for run in found
        ]
    return tuple(found)


class _Loop:
    """The signals of one loop, by run and stamp."""

    def __init__(self, signals: LoopSignals, space: str, source: Source) -> None:
        self._signals, self._space, self._source = signals, space, source
        given_op = signals.op(space)
        self.outputs, self.valves = signals.tags(space, "pv"), signals.tags(space, given_op)
        pv = signals.given(space, "pv", self.outputs)
        if not pv or not self.valves:
            what = "pv" if not pv else given_op
            tags = self.outputs if not pv else self.valves
            raise InputError(
                f"holds no usable message of {what}",
                where=source.where,
                fix=signals.skipped(space, what, tags),
            )
        told = tell_runs([g.stamp for g in pv], [g.number for g in pv])
        self.runs = told.runs
        self._every = sorted((*told.runs, *told.strays), key=lambda run: run.begin)
        widths = {"pv": self.outputs, "sp": self.outputs, "op": self.valves}
        widths |= {"op_applied": self.valves, "stem": self.valves}
        skipped = [signals.skipped(space, signal, tags) for signal, tags in widths.items()]
        self.notes = [sentence for sentence in skipped if sentence]
        self._only_applied = given_op != "op"
        if self._only_applied:
            self.notes.append("no topic op, op_applied is taken as OP")
        if told.lost:
            self.notes.append(f"{told.lost} messages of pv whose stamps are out of order left out")
        if len(self.runs) > 1:
            self.notes.append(f"{len(self.runs)} runs are told apart: stamps fall back")
        self._pv = {g.number: g.values for g in pv}
        self._of = {
            signal: self._by_run(signals.given(space, signal, self.valves))
            for signal in ("op", "op_applied", "stem")
        }
        self._sp = self._set_points(signals.given(space, "sp", self.outputs))
        self._sp_lacks = bool(not self._sp and signals.tags(space, "sp"))

    def run(self, number: int, notes: Sequence[str]) -> LoopRun:
        """Return one run; InputError for fewer than two samples, or none that are regular."""
        run, said = self.runs[number], list(notes)
        pv = {stamp: self._pv[place] for stamp, place in run.place.items()}
        op = self._op(number, pv, said)
        stamps = np.array(sorted(pv.keys() & op.keys()), dtype=np.int64)
        first = int(stamps[0]) if len(stamps) else 0
        whole = Whole(
            valves=self.valves,
            outputs=self.outputs,
            time=(stamps - first) / 1e9,
            start=0.0,
            op=_at(stamps, op, self.valves),
            pv=_at(stamps, pv, self.outputs),
            sp=self._held(number, stamps, said),
            stem=self._stem(number, stamps, said),
        )
        parts = whole.records(self._source, said)
        begin = first + round(parts[0].start * 1e9)
        parts = tuple(_with_known(part, first, pv, op) for part in parts)
        moved = tuple(dataclasses.replace(p, start=first / 1e9 + p.start) for p in parts)
        return LoopRun(run.begin, run.end, begin, moved)

    def _by_run(self, given: Sequence[Given]) -> list[Samples]:
        """Return the messages of a signal for each run."""
        found: list[Samples] = [{} for _ in self.runs]
        off: list[dict[int, int]] = [{} for _ in self.runs]
        places = {id(run): number for number, run in enumerate(self.runs)}
        for message in given:
            stamp = message.stamp
            run = run_of(self._every, stamp, message.number)
            number = places.get(id(run))
            if number is None:
                continue  # of a stretch that is no run
            away = abs(run.place.get(stamp, message.number) - message.number)
            if away <= off[number].get(stamp, away):
                found[number][stamp], off[number][stamp] = message.values, away
        return found

    def _set_points(self, given: Sequence[Given]) -> list[Samples]:
        """Return the set-points for each run; those in force when it begins come with it."""
        if not given:
            return []
        found = self._by_run(given)
        for number, run in enumerate(self.runs[1:], start=1):
            before = [g for g in given if g.number < run.begin]
            if before and min(found[number], default=run.last) > run.first:
                found[number][run.first] = before[-1].values
        return found

    def _op(self, number: int, pv: Mapping[int, Any], notes: list[str]) -> Samples:
        """Return OP by stamp: what was applied where that is known, else what was commanded."""
        op, applied = self._of["op"][number], self._of["op_applied"][number]
        alone = len(pv.keys() - (op.keys() | applied.keys())) + len(op.keys() - pv.keys())
        if alone:
            notes.append(f"{alone} messages of pv or op without the other of their stamp left out")
        other = sum(op[stamp] != row for stamp, row in applied.items() if stamp in op)
        if other:
            notes.append(f"op_applied differs from op at {other} samples and is taken there")
        added = len((applied.keys() - op.keys()) & pv.keys())
        if added and not self._only_applied:
            notes.append(f"no op at {added} samples, op_applied is taken there")
        return {**op, **applied}

    def _held(
        self, number: int, stamps: np.ndarray[Any, Any], notes: list[str]
    ) -> FloatArray | None:
        """Return the last set-points given at or before each stamp."""
        known = self._sp[number] if self._sp else {}
        if not known or not len(stamps):
            if self._sp_lacks:
                notes.append("sp has no value for every pv, left out")
            return None
        late = int(np.count_nonzero(stamps < min(known)))
        if late:
            notes.append(f"no sp for the first {late} samples, the first one given is taken")
        return _latest(stamps, known, self.outputs)

    def _stem(
        self, number: int, stamps: np.ndarray[Any, Any], notes: list[str]
    ) -> FloatArray | None:
        known = self._of["stem"][number]
        if not self._signals.tags(self._space, "stem"):
            return None
        there = {stamp: known[stamp] for stamp in stamps.tolist() if stamp in known}
        missing = len(stamps) - len(there)
        said = f"stem is missing at {missing} of {len(stamps)} samples"
        if not there or missing > max(1, len(stamps) * MOST_HELD):
            notes.append(f"{said}, all of it is left out")
            return None
        if missing:
            notes.append(f"{said}, the one before is held there")
        return _latest(stamps, there, self.valves)


def _at(stamps: np.ndarray[Any, Any], samples: Samples, tags: tuple[str, ...]) -> FloatArray:
    """Return the values at ``stamps``, shape (N, len(tags))."""
    rows = [[samples[stamp][tag] for tag in tags] for stamp in stamps.tolist()]
    return np.array(rows, dtype=float).reshape(len(stamps), len(tags))


def _with_known(record: Record, first: int, pv: Samples, op: Samples) -> Record:
    """Return the record with what is known, by stamp, of samples that lack PV or OP."""
    held = np.flatnonzero(record.quality == Quality.HELD).tolist()
    if not held:
        return record
    values = {"pv": record.pv.copy(), "op": record.op.copy()}
    tags = {"pv": record.outputs, "op": record.valves}
    for row in held:
        stamp = first + round((record.start + row * record.sample_time) * 1e9)
        for signal, samples in (("pv", pv), ("op", op)):
            if stamp in samples:
                values[signal][row] = [samples[stamp][tag] for tag in tags[signal]]
    return dataclasses.replace(record, pv=values["pv"], op=values["op"])


def _latest(stamps: np.ndarray[Any, Any], known: Samples, tags: tuple[str, ...]) -> FloatArray:
    """Return the values given last at or before each stamp; before the first, the first."""
    given = np.array(sorted(known), dtype=np.int64)
    index = np.searchsorted(given, stamps, side="right") - 1
    return _at(given, known, tags)[np.maximum(index, 0)]


def read_bag_parts(path: str | Path, *, namespace: str | None = None) -> tuple[Record, ...]:
    """Read the records of a loop from a bag, one for each stretch without a gap.

    Bad messages are left out; short holes are held, which the mask says; runs are told apart
    where stamps fall back. The notes of each record say what was done. The ``namespace`` is that of
    the loop's topics, needed when the bag holds several loops.

    Raises:
        InputError: as :func:`read_messages`; no ``pv`` or ``op``; stamps that are irregular.
    """
    return _parts(path, *_signals(path), namespace)


def read_bag_loops(path: str | Path) -> dict[str, tuple[Record, ...] | InputError]:
    """Return the records of every loop by its namespace, as ``/unit1``, or why there are none."""
    signals, notes = _signals(path)
    found: dict[str, tuple[Record, ...] | InputError] = {}
    for space in signals.loops or ("",):
        try:
            chosen = (space or "/") if signals.loops else None
            found[space] = _parts(path, signals, notes, chosen)
        except InputError as error:
            found[space] = error
    return found


def bag_source(path: str | Path) -> Source:
    """Return how errors and records name a bag."""
    return Source(
        Path(path).name, str(path), lambda row: f"sample {row} of pv and op", cut_holes=True
    )


def _signals(path: str | Path) -> tuple[LoopSignals, list[str]]:
    """Return the signals of all loops in a bag, and what was left out while reading."""
    notes: list[str] = []
    signals = LoopSignals(str(path))
    for number, message in enumerate(read_messages(path, wanted=is_signal, notes=notes)):
        signals.add(message, number)
    return signals, notes


def _parts(
    path: str | Path, signals: LoopSignals, notes: list[str], namespace: str | None
) -> tuple[Record, ...]:
    runs = loop_runs(signals, bag_source(path), namespace, notes)
    return tuple(part for run in runs for part in run.parts)
