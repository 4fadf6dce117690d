"""What a bag of the live loop tells besides its record: estimates, modes, configuration."""

from __future__ import annotations

import dataclasses
import json
import types
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records.answer_times import answer_times
from stiction_ros.records.bag_messages import (
    BagMessage,
    MessageDecoder,
    last_part,
    read_raw,
    stamp_ns,
)
from stiction_ros.records.bag_metadata import BagTopic
from stiction_ros.records.bag_reader import JOINT_STATE, LoopSignals, is_signal
from stiction_ros.records.gap_log import GapLog, gap_log
from stiction_ros.records.record import Record

_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_STRING = "std_msgs/msg/String"
_CLOCK = "rosgraph_msgs/msg/Clock"
_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"


@dataclasses.dataclass(frozen=True)
class Estimate:
    """One parameter of one fit.

    Attributes:
        stamp: end of the window, ns.
        name: ``V1.f_s``.
        value: estimate, % of travel for friction.
        low: lower end of its interval, NaN when not given.
        high: upper end of its interval, NaN when not given.
    """

    stamp: int
    name: str
    value: float
    low: float
    high: float


@dataclasses.dataclass(frozen=True)
class ModeChange:
    """The controller's mode from a moment on.

    Attributes:
        stamp: of the first ``op`` of the new mode, ns.
        mode: ``unaware``, ``embedding``, ``inversion`` or ``hold``.
        model: of the valves that it works with, as the controller names it.
        reason: why it changed.
        frictions: what it takes for the friction of its valves, by ``V1.f_s``, %.
    """

    stamp: int
    mode: str
    model: str = ""
    reason: str = ""
    frictions: Mapping[str, float] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Fit:
    """One fit of the estimator.

    Attributes:
        stamp: end of the window, ns.
        identification: the mapping of ``identify --json`` without ``record``.
        trusted: friction trusted after this fit, by ``V1.f_s``, %.
    """

    stamp: int
    identification: Mapping[str, Any]
    trusted: Mapping[str, float]


@dataclasses.dataclass(frozen=True)
class Text:
    """A string that a node published: its topic, log time in ns and content."""

    topic: str
    log_time: int
    text: str


@dataclasses.dataclass(frozen=True)
class RunLog:
    """A run of the live loop as its bag tells it.

    Attributes:
        record: the loop's signals.
        start: stamp of the record's first sample, ns.
        estimates: in the order they came.
        modes: every change of mode, model or friction, the mode at the start first.
        loop_models: the YAML texts on ``loop_model``.
        configs: what the nodes published on ``~/config``.
        clock: the simulated times on ``/clock``, ns.
        recorded: messages in the bag by topic.
        published: messages by topic as the nodes counted them in ``/diagnostics``.
        notes: what was left out while reading, one sentence each.
        fits: in the order of their windows.
        stem_estimate: the controller's estimate of the stem positions at the record's
            samples, shape (N, m), %, NaN where none was published; None when there is none.
        gaps: what the monitor told.
        pv_to_op_ms: p50, p99, p999 and max of the times from PV to OP; empty in lockstep.
        wall_seconds: from the first to the last publication, on the publishers' clock.
    """

    record: Record
    start: int
    estimates: tuple[Estimate, ...]
    modes: tuple[ModeChange, ...]
    loop_models: tuple[Text, ...]
    configs: tuple[Text, ...]
    clock: tuple[int, ...]
    recorded: Mapping[str, int]
    published: Mapping[str, int]
    notes: tuple[str, ...] = ()
    fits: tuple[Fit, ...] = ()
    stem_estimate: FloatArray | None = None
    wall_seconds: float = float("nan")
    gaps: GapLog = GapLog({}, {})
    pv_to_op_ms: Mapping[str, float] = dataclasses.field(default_factory=dict)

    def seconds(self, stamp: int) -> float:
        """Return the time of a stamp in s since the first sample."""
        return (stamp - self.start) / 1e9

    @property
    def swap(self) -> ModeChange | None:
        """The first change from ``unaware`` to a mode that knows of the friction.

        A change whose first sample is not in the record, as it was cut there, is none.
        """
        before = ""
        end = self.start + round(len(self.record) * self.record.sample_time * 1e9)
        for change in self.modes:
            if change.stamp >= end:
                break
            if before == "unaware" and change.mode in ("embedding", "inversion"):
                return change
            before = change.mode
        return None

    @property
    def swap_sample(self) -> int | None:
        """Number of the record's sample at which the swap took place."""
        if self.swap is None:
            return None
        return round(self.seconds(self.swap.stamp) / self.record.sample_time)

    @property
    def fit_at_swap(self) -> Fit | None:
        """The last fit whose window ended before the swap."""
        if self.swap is None:
            return None
        return max(
            (fit for fit in self.fits if fit.stamp < self.swap.stamp),
            key=lambda fit: fit.stamp,
            default=None,
        )


def read_run(path: str | Path, *, namespace: str | None = None) -> RunLog:
    """Read everything that a report needs from a bag, in one pass.

    Args:
        path: a rosbag2 directory, finished or not, or a ``.mcap`` file.
        namespace: of the loop's topics; needed when the bag holds several loops.

    Raises:
        InputError: as :func:`stiction_ros.records.bag_reader.read_bag`.
    """
    notes: list[str] = []
    recorded: Counter[str] = Counter()
    messages: list[BagMessage] = []
    signals = LoopSignals(str(path))
    decoder = MessageDecoder()
    sent: list[int] = []
    for raw in read_raw(path, notes):
        recorded[raw.topic.name] += 1
        sent.append(raw.publish_time)
        signal = is_signal(raw.topic)
        if not signal and not _wanted(raw.topic):
            continue
        message = decoder.decode(raw, str(path))
        if message is None:
            continue
        if signal:
            signals.add(message)
        else:
            messages.append(message)
    notes.extend(decoder.notes)
    published = published_counts(messages)
    record = signals.record(Path(path).name, namespace, notes)
    start = signals.first_stamp(namespace)
    if len(signals.loops) > 1:
        messages = of_loop(messages, signals.loop(namespace))
    stamps = start + np.rint(record.time * 1e9).astype(np.int64)
    return RunLog(
        record=record,
        start=start,
        estimates=estimates(messages),
        modes=mode_changes(messages) or mode_texts(messages),
        loop_models=texts(messages, "loop_model"),
        configs=texts(messages, "config"),
        clock=clock(messages),
        recorded=dict(recorded),
        published=published,
        notes=record.notes,
        fits=fits(messages),
        stem_estimate=stem_estimate(messages, stamps.tolist(), record.valves),
        wall_seconds=(max(sent) - min(sent)) / 1e9,
        gaps=gap_log(messages),
        pv_to_op_ms=answer_times(messages),
    )


def of_loop(messages: Iterable[BagMessage], space: str) -> list[BagMessage]:
    """Return the messages of the loop in the namespace ``space``, and what is global.

    The diagnostics of all loops share a topic; of these the statuses of the loop's nodes
    are kept, which begin with its namespace.
    """
    kept = []
    for message in messages:
        namespace, name = last_part(message.topic)
        if name == "diagnostics":
            header, every = message.message.header, message.message.status
            own = [s for s in every if last_part("/" + node_of(s))[0] == space]
            only = types.SimpleNamespace(header=header, status=own)
            kept.append(dataclasses.replace(message, message=only))
        elif (
            name == "clock" or (last_part(namespace)[0] if name == "config" else namespace) == space
        ):
            kept.append(message)
    return kept


def node_of(status: Any) -> str:
    """Return the node that gave a diagnostic status: what stands before the colon."""
    return str(status.name).partition(":")[0].strip()


def estimates(messages: Iterable[BagMessage]) -> tuple[Estimate, ...]:
    """Return the estimates on ``stiction`` in their order."""
    found = []
    for message in _of(messages, JOINT_STATE, "stiction"):
        state = message.message
        stamp = stamp_ns(state)
        for index, (name, value) in enumerate(zip(state.name, state.position, strict=False)):
            low = _item(state.velocity, index)
            high = _item(state.effort, index)
            found.append(Estimate(stamp, str(name), float(value), low, high))
    return tuple(found)


def mode_changes(messages: Iterable[BagMessage]) -> tuple[ModeChange, ...]:
    """Return the changes of mode, model or friction in ``/diagnostics``, with swap times."""
    changes: list[ModeChange] = []
    for message in _of(messages, _DIAGNOSTICS, "diagnostics"):
        for status in message.message.status:
            values = {item.key: item.value for item in status.values}
            if "mode" not in values:
                continue
            change = ModeChange(
                stamp_ns(message.message),
                values["mode"],
                values.get("model", ""),
                values.get("reason", ""),
                _frictions(values, "."),
            )
            if not changes or _force(changes[-1]) != _force(change):
                changes.append(change)
    return tuple(changes)


def fits(messages: Iterable[BagMessage]) -> tuple[Fit, ...]:
    """Return the fits that ``/diagnostics`` tells, by the end of their window."""
    found: dict[int, Fit] = {}
    for message in _of(messages, _DIAGNOSTICS, "diagnostics"):
        for status in message.message.status:
            values = {item.key: item.value for item in status.values}
            if "identification" not in values or not values.get("window_end", "").isdecimal():
                continue
            try:
                identification = json.loads(values["identification"])
            except json.JSONDecodeError:
                continue
            if isinstance(identification, dict):
                stamp = int(values["window_end"])
                found[stamp] = Fit(stamp, identification, _frictions(values, ".trusted_"))
    return tuple(found[stamp] for stamp in sorted(found))


def stem_estimate(
    messages: Iterable[BagMessage], stamps: Sequence[int], valves: Sequence[str]
) -> FloatArray | None:
    """Return the stem positions, shape (N, m), in the first points on ``prediction``."""
    rows: dict[int, list[float]] = {}
    for message in _of(messages, _TRAJECTORY, "prediction"):
        plan = message.message
        if not plan.points:
            continue
        found = dict(zip(plan.joint_names, plan.points[0].positions, strict=False))
        rows[stamp_ns(plan)] = [float(found.get(name, np.nan)) for name in valves]
    if not rows:
        return None
    unknown = [float("nan")] * len(valves)
    return np.array([rows.get(stamp, unknown) for stamp in stamps]).reshape(-1, len(valves))


def _force(change: ModeChange) -> tuple[object, ...]:
    return change.mode, change.model, change.frictions


def _frictions(values: Mapping[str, str], mark: str) -> dict[str, float]:
    """Return ``V1.f_s`` → value from keys such as ``V1.f_s`` or ``V1.trusted_f_s``."""
    found = {}
    for key, value in values.items():
        valve, dot, name = key.rpartition(mark)
        if not (valve and dot and name in ("f_s", "f_d")):
            continue
        try:
            found[f"{valve}.{name}"] = float(value)
        except ValueError:
            continue
    return found


def mode_texts(messages: Iterable[BagMessage]) -> tuple[ModeChange, ...]:
    """Return the changes on ``mode``, whose messages bear no stamp: log times stand in."""
    changes: list[ModeChange] = []
    for text in texts(messages, "mode"):
        if not changes or changes[-1].mode != text.text:
            changes.append(ModeChange(text.log_time, text.text, reason="time of reception"))
    return tuple(changes)


def texts(messages: Iterable[BagMessage], name: str) -> tuple[Text, ...]:
    """Return the strings on topics whose last part is ``name``."""
    return tuple(
        Text(message.topic, message.log_time, str(message.message.data))
        for message in _of(messages, _STRING, name)
    )


def clock(messages: Iterable[BagMessage]) -> tuple[int, ...]:
    """Return the times on ``/clock``, ns."""
    return tuple(
        int(message.message.clock.sec) * 10**9 + int(message.message.clock.nanosec)
        for message in _of(messages, _CLOCK, "clock")
    )


def published_counts(messages: Iterable[BagMessage]) -> dict[str, int]:
    """Return how many messages of each topic the nodes say they published.

    The keys are ``published:<topic>`` (or with a space); of one node, named before the
    colon in the status name, the last count holds; several nodes on a topic add up.
    """
    last: dict[tuple[str, str], int] = {}
    for message in _of(messages, _DIAGNOSTICS, "diagnostics"):
        for status in message.message.status:
            node = node_of(status)
            for item in status.values:
                key = str(item.key)
                if key.startswith(("published:", "published ")) and item.value.isdecimal():
                    last[node, key[len("published:") :].strip()] = int(item.value)
    totals: Counter[str] = Counter()
    for (_, topic), count in last.items():
        totals[topic] += count
    return dict(totals)


def _wanted(topic: BagTopic) -> bool:
    name = last_part(topic.name)[1]
    return (topic.type, name) in {
        (JOINT_STATE, "stiction"),
        (_DIAGNOSTICS, "diagnostics"),
        (_CLOCK, "clock"),
        (_TRAJECTORY, "prediction"),
        (_STRING, "mode"),
        (_STRING, "loop_model"),
        (_STRING, "config"),
    }


def _of(messages: Iterable[BagMessage], type_name: str, name: str) -> Iterable[BagMessage]:
    return (m for m in messages if m.type == type_name and last_part(m.topic)[1] == name)


def _item(values: Iterable[float], index: int) -> float:
    items = list(values)
    return float(items[index]) if index < len(items) else float("nan")
