"""Reads the record of a loop from a bag."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.records.bag_messages import (
    BagMessage,
    last_part,
    read_messages,
    read_raw,
    stamp_ns,
)
from stiction_ros.records.bag_metadata import BagTopic
from stiction_ros.records.record import Record
from stiction_ros.records.sampling import sample_time

__all__ = ["BagMessage", "LoopSignals", "is_signal", "read_bag", "read_messages", "read_raw"]

JOINT_STATE = "sensor_msgs/msg/JointState"
_SIGNALS = ("pv", "sp", "op", "stem")


def read_bag(path: str | Path, *, namespace: str | None = None) -> Record:
    """Read the record of a loop from ``pv``, ``sp``, ``op``, ``stem`` in a bag.

    Args:
        path: a rosbag2 directory, finished or not, or a ``.mcap`` file.
        namespace: of the loop's topics; needed when the bag holds several loops.

    Raises:
        InputError: as :func:`read_messages`; no ``pv`` or ``op``; stamps that are irregular.
    """
    notes: list[str] = []
    messages = read_messages(path, wanted=is_signal, notes=notes)
    signals = LoopSignals(str(path))
    for message in messages:
        signals.add(message)
    return signals.record(Path(path).name, namespace, notes)


def is_signal(topic: BagTopic) -> bool:
    """Tell whether a topic is one of the loop's signals."""
    return topic.type == JOINT_STATE and last_part(topic.name)[1] in _SIGNALS


Samples = dict[int, dict[str, float]]
"""Stamp in ns to tag to value."""


MOST_HELD = 0.01  # share of the samples at which a missing stem is held


class LoopSignals:
    """Collects the signals of loops from their messages and joins them by stamp.

    Args:
        where: the bag, for errors.
    """

    def __init__(self, where: str) -> None:
        self._where = where
        self._samples: dict[str, dict[str, Samples]] = {}
        self._tags: dict[tuple[str, str], tuple[str, ...]] = {}

    def add(self, message: BagMessage) -> None:
        """Take one message of a signal.

        Raises:
            InputError: it has not as many values as names.
        """
        namespace, signal = last_part(message.topic)
        names, values = message.message.name, message.message.position
        if len(names) != len(values):
            raise InputError(
                f"a message of {message.topic} has {len(names)} names and {len(values)} positions",
                where=self._where,
                fix="give each name one position",
            )
        self._tags.setdefault((namespace, signal), tuple(names))
        samples = self._samples.setdefault(namespace, {}).setdefault(signal, {})
        samples[stamp_ns(message.message)] = dict(zip(names, values, strict=True))

    def record(self, name: str, namespace: str | None, notes: Iterable[str]) -> Record:
        """Join what was collected.

        A stamp counts when ``pv`` and ``op`` both have it; ``sp`` is held from one message
        to the next; ``stem`` is dropped with a note when a stamp lacks it.

        Args:
            name: of the record.
            namespace: of the loop; None when there is only one.
            notes: to put before its own.

        Raises:
            InputError: see :func:`read_bag`.
        """
        notes = list(notes)
        try:
            space = self.loop(namespace)
        except InputError as error:
            unread = [note for note in notes if "cannot be decoded" in note]
            if unread:
                raise InputError(error.what, where=error.where, fix="; ".join(unread)) from None
            raise
        signals = self._samples[space]
        pv, op = signals["pv"], signals["op"]
        stamps = np.array(sorted(pv.keys() & op.keys()), dtype=np.int64)
        first = int(stamps[0]) if len(stamps) else 0
        step, more = sample_time(
            (stamps - first) / 1e9, self._where, lambda row: f"sample {row} of pv and op"
        )
        notes.extend(more)
        alone = len(pv) + len(op) - 2 * len(stamps)
        if alone:
            notes.append(f"{alone} messages of pv or op without the other of their stamp left out")
        outputs, valves = self._tags[space, "pv"], self._tags[space, "op"]
        return Record(
            name=name,
            sample_time=step,
            valves=valves,
            outputs=outputs,
            op=self._at(stamps, op, valves, "op"),
            pv=self._at(stamps, pv, outputs, "pv"),
            sp=self._held(stamps, signals.get("sp", {}), outputs, notes),
            stem=self._stem(stamps, signals.get("stem", {}), valves, notes),
            start=first / 1e9,
            notes=tuple(notes),
        )

    def first_stamp(self, namespace: str | None) -> int:
        """Return the stamp of the record's first sample, ns."""
        signals = self._samples[self.loop(namespace)]
        return min(signals["pv"].keys() & signals["op"].keys())

    @property
    def loops(self) -> tuple[str, ...]:
        """Namespaces that have both ``pv`` and ``op``, such as ``/unit1``, empty for ``/``."""
        both = {"pv", "op"}
        return tuple(space for space, found in self._samples.items() if both <= found.keys())

    def loop(self, namespace: str | None) -> str:
        """Return the namespace of the loop that is meant.

        Raises:
            InputError: there is no such loop, or there are several and none was chosen.
        """
        loops = list(self.loops)
        if namespace is not None:
            wanted = "/" + namespace.strip("/") if namespace.strip("/") else ""
            loops = [space for space in loops if space == wanted]
        if not loops:
            raise self._no_loop(namespace)
        if len(loops) > 1:
            raise InputError(
                f"holds {len(loops)} loops ({', '.join(space or '/' for space in sorted(loops))})",
                where=self._where,
                fix="choose one with --namespace",
            )
        return loops[0]

    def _no_loop(self, namespace: str | None) -> InputError:
        there = sorted(space or "/" for space, found in self._samples.items() if "pv" in found)
        fix = "record both"
        if namespace is not None and there:
            fix = f"there are {', '.join(there)}"
        where_in = "" if namespace is None else f" in the namespace {namespace}"
        return InputError(
            f"holds no topics pv and op of {JOINT_STATE}{where_in}", where=self._where, fix=fix
        )

    def _at(
        self, stamps: np.ndarray[Any, Any], samples: Samples, tags: tuple[str, ...], signal: str
    ) -> FloatArray:
        """Return the values at ``stamps``, shape (N, len(tags))."""
        try:
            rows = [[samples[stamp][tag] for tag in tags] for stamp in stamps.tolist()]
        except KeyError as error:
            raise InputError(
                f"a message of {signal} has no value for {error}",
                where=self._where,
                fix=f"every message needs {', '.join(tags)}",
            ) from None
        return np.array(rows, dtype=float).reshape(len(stamps), len(tags))

    def _held(
        self,
        stamps: np.ndarray[Any, Any],
        samples: Samples,
        tags: tuple[str, ...],
        notes: list[str],
    ) -> FloatArray | None:
        """Return the last set-points given at or before each stamp."""
        known = _whole(samples, tags)
        if not known:
            if samples:
                notes.append("sp has no value for every pv, left out")
            return None
        late = int(np.count_nonzero(stamps < min(known)))
        if late:
            notes.append(f"no sp for the first {late} samples, the first one given is taken")
        return self._latest(stamps, known, tags, "sp")

    def _stem(
        self,
        stamps: np.ndarray[Any, Any],
        samples: Samples,
        tags: tuple[str, ...],
        notes: list[str],
    ) -> FloatArray | None:
        if not samples:
            return None
        known = _whole(samples, tags)
        there = {stamp: known[stamp] for stamp in stamps.tolist() if stamp in known}
        missing = len(stamps) - len(there)
        said = f"stem is missing at {missing} of {len(stamps)} samples"
        if not there or missing > max(1, len(stamps) * MOST_HELD):
            notes.append(f"{said}, all of it is left out")
            return None
        if missing:
            notes.append(f"{said}, the one before is held there")
        return self._latest(stamps, there, tags, "stem")

    def _latest(
        self, stamps: np.ndarray[Any, Any], known: Samples, tags: tuple[str, ...], signal: str
    ) -> FloatArray:
        """Return the values given last at or before each stamp; before the first, the first."""
        given = np.array(sorted(known), dtype=np.int64)
        index = np.searchsorted(given, stamps, side="right") - 1
        return self._at(given, known, tags, signal)[np.maximum(index, 0)]


def _whole(samples: Samples, tags: tuple[str, ...]) -> Samples:
    """Return the messages that have a value for every tag, by stamp."""
    return {stamp: row for stamp, row in samples.items() if row.keys() >= set(tags)}
