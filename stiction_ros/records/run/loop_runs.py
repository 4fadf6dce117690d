"""Joins the signals of a loop by stamp: runs, and records without a gap of each."""

import dataclasses
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import BagMessage, MessageDecoder, Wanted, read_raw
from stiction_ros.records.record import Quality, Record
from stiction_ros.records.run.bag_runs import run_of, tell_runs
from stiction_ros.records.run.loop_signals import Given, LoopSignals, is_signal
from stiction_ros.records.whole import Whole

Samples = dict[int, tuple[float, ...]]  # stamp in ns to the value of each tag
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

    def noting(self, note: str) -> "LoopRun":
        """Return the run with a note more on each part."""
        parts = (dataclasses.replace(part, notes=(*part.notes, note)) for part in self.parts)
        return dataclasses.replace(self, parts=tuple(parts))


class _Loop:
    """The signals of one loop, by run and stamp."""

    def __init__(self, signals: LoopSignals, space: str) -> None:
        self._where = signals.where
        given_op = signals.op(space)
        self.outputs, self.valves = signals.tags(space, "pv"), signals.tags(space, given_op)
        widths = {"pv": self.outputs, "sp": self.outputs, "op": self.valves}
        widths |= {"op_applied": self.valves, "stem": self.valves}
        given = {signal: signals.given(space, signal, tags) for signal, tags in widths.items()}
        pv = given["pv"]
        if not pv or not self.valves:
            what = "pv" if not pv else given_op
            tags = self.outputs if not pv else self.valves
            raise InputError(
                f"holds no usable message of {what}",
                where=self._where,
                fix=signals.skipped(space, what, tags),
            )
        told = tell_runs([g.stamp for g in pv], [g.number for g in pv])
        self.runs = told.runs
        self._every = sorted((*told.runs, *told.strays), key=lambda run: run.begin)
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
        self._of = {signal: self._by_run(given[signal]) for signal in widths if signal != "pv"}
        self._set_points(given["sp"])
        self._has_stem = bool(signals.tags(space, "stem"))

    def run(self, number: int, notes: Sequence[str]) -> LoopRun:
        """Return one run; InputError for fewer than two samples, or none that are regular."""
        run, said = self.runs[number], list(notes)
        pv = {stamp: self._pv[place] for stamp, place in run.place.items()}
        op = self._op(number, pv, said)
        stamps = np.array(sorted(pv.keys() & op.keys()), dtype=np.int64)
        first = int(stamps[0]) if len(stamps) else 0
        signals = {
            "op": _at(stamps, op, len(self.valves)),
            "pv": _at(stamps, pv, len(self.outputs)),
            "sp": self._held(number, stamps, said),
            "stem": self._stem(number, stamps, said),
        }
        whole = Whole(
            name=Path(self._where).name,
            where=self._where,
            place=lambda row: f"sample {row} of pv and op",
            valves=self.valves,
            outputs=self.outputs,
            time=(stamps - first) / 1e9,
            start=0.0,
            signals={key: values for key, values in signals.items() if values is not None},
            cut_holes=True,
        )
        parts = whole.records(said)
        begin = first + round(parts[0].start * 1e9)
        parts = tuple(_with_known(part, first, pv=pv, op=op) for part in parts)
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

    def _set_points(self, given: Sequence[Given]) -> None:
        """Put the set-points in force when a run begins at its beginning."""
        for found, run in zip(self._of["sp"][1:], self.runs[1:], strict=True):
            before = [g for g in given if g.number < run.begin]
            if before and min(found, default=run.last) > run.first:
                found[run.first] = before[-1].values

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

    def _held(self, number: int, stamps: IntArray, notes: list[str]) -> FloatArray | None:
        """Return the last set-points given at or before each stamp."""
        known = self._of["sp"][number]
        if not known or not len(stamps):
            return None
        late = int(np.count_nonzero(stamps < min(known)))
        if late:
            notes.append(f"no sp for the first {late} samples, the first one given is taken")
        return _latest(stamps, known)

    def _stem(self, number: int, stamps: IntArray, notes: list[str]) -> FloatArray | None:
        if not self._has_stem:
            return None
        known = self._of["stem"][number]
        there = {stamp: known[stamp] for stamp in stamps.tolist() if stamp in known}
        missing = len(stamps) - len(there)
        said = f"stem is missing at {missing} of {len(stamps)} samples"
        if not there or missing > max(1, len(stamps) * MOST_HELD):
            notes.append(f"{said}, all of it is left out")
            return None
        if missing:
            notes.append(f"{said}, the one before is held there")
        return _latest(stamps, there)


def _at(stamps: IntArray, samples: Samples, width: int) -> FloatArray:
    """Return the values at ``stamps``, shape (N, width)."""
    return np.array([samples[k] for k in stamps.tolist()], dtype=float).reshape(-1, width)


def _latest(stamps: IntArray, known: Samples) -> FloatArray:
    """Return the values given last at or before each stamp; before the first, the first."""
    given = sorted(known)
    index = np.searchsorted(given, stamps, side="right") - 1
    return np.array([known[stamp] for stamp in given])[np.maximum(index, 0)]


def _with_known(record: Record, first: int, **known: Samples) -> Record:
    """Return the record with what is known, by signal and stamp, of samples that lack PV or OP."""
    held = np.flatnonzero(record.quality == Quality.HELD)
    stamps = first + np.rint((record.start + held * record.sample_time) * 1e9).astype(np.int64)
    changed = {signal: getattr(record, signal).copy() for signal in known}
    for signal, samples in known.items():
        for row, stamp in zip(held.tolist(), stamps.tolist(), strict=True):
            if stamp in samples:
                changed[signal][row] = samples[stamp]
    return dataclasses.replace(record, **changed) if len(held) else record


@dataclasses.dataclass(frozen=True)
class BagLoops:
    """What a bag holds, of all its loops."""

    signals: LoopSignals
    # other messages that were wanted, with numbers between those of the signals around them
    others: Sequence[tuple[float, BagMessage]]
    recorded: Mapping[str, int]  # messages by topic
    wall_seconds: float  # from first to last publication, on the publishers' clock
    notes: Sequence[str]  # what was left out

    @classmethod
    def read(cls, path: str | Path, others: Wanted = lambda topic: False) -> "BagLoops":
        """Read a bag in one pass."""
        signals, count = LoopSignals(str(path)), 0
        messages: list[tuple[float, BagMessage]] = []
        notes: list[str] = []
        decoder, recorded, sent = MessageDecoder(), Counter[str](), list[int]()
        for raw in read_raw(path, notes):
            recorded[raw.topic.name] += 1
            sent.append(raw.publish_time)
            signal = is_signal(raw.topic)
            message = decoder.decode(raw, str(path)) if signal or others(raw.topic) else None
            if message is not None and signal:
                signals.add(message, count)
                count += 1
            elif message is not None:
                messages.append((count - 0.5, message))
        notes += decoder.notes
        seconds = (max(sent, default=0) - min(sent, default=0)) / 1e9
        return cls(signals, messages, recorded, seconds, notes)

    def runs(self, namespace: str | None) -> tuple[LoopRun, ...]:
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
            space = self.signals.loop(namespace)
        except InputError as error:
            said = [n.removesuffix(", left out") for n in self.notes if "cannot be decoded" in n]
            if not said:
                raise
            what = f"{error.what} that can be read: {', '.join(said)}"
            fix = "record it again with definitions in ros2msg, as `ros2 bag record -s mcap` does"
            raise InputError(what, where=error.where, fix=fix) from None
        loop = _Loop(self.signals, space)
        notes = [*self.notes, *loop.notes]
        found: list[LoopRun] = []
        refused: list[InputError] = []
        for number in range(len(loop.runs)):
            try:
                found.append(loop.run(number, notes))
            except InputError as error:
                refused.append(error)
        if not found:
            raise refused[0]
        if refused:
            note = f"{len(refused)} runs left out: {refused[0].what}"
            found = [run.noting(note) for run in found]
        return tuple(found)

    def parts(self, namespace: str | None) -> tuple[Record, ...]:
        return tuple(part for run in self.runs(namespace) for part in run.parts)


def read_bag_parts(path: str | Path, *, namespace: str | None = None) -> tuple[Record, ...]:
    """Read the records of a loop from a bag, one for each stretch without a gap.

    Bad messages are left out; short holes are held, which the mask says; runs are told apart
    where stamps fall back. The notes of each record say what was done. The ``namespace`` is that of
    the loop's topics, needed when the bag holds several loops.

    Raises:
        InputError: as :func:`read_raw`; no ``pv`` or ``op``; stamps that are irregular.
    """
    return BagLoops.read(path).parts(namespace)


def read_bag_loops(path: str | Path) -> dict[str, tuple[Record, ...] | InputError]:
    """Return the records of every loop by its namespace, as ``/unit1``, or why there are none."""
    content = BagLoops.read(path)
    found: dict[str, tuple[Record, ...] | InputError] = {}
    for space in content.signals.loops or ("",):
        try:
            found[space] = content.parts((space or "/") if content.signals.loops else None)
        except InputError as error:
            found[space] = error
    return found
