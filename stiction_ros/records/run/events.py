"""What the nodes of a live loop said besides its signals: modes, fits, gaps, texts."""

import contextlib
import dataclasses
import json
import math
import types
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records.bag.messages import BagMessage, last_part, stamp_ns
from stiction_ros.records.record import Record
from stiction_ros.records.run.loop_signals import JOINT_STATE
from stiction_ros.records.storage.bag_metadata import BagTopic

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
STRING = "std_msgs/msg/String"
_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
FIGURES = ("p50", "p99", "p999", "max")


@dataclasses.dataclass(frozen=True)
class ModeChange:
    """The controller's mode from a moment on."""

    stamp: int  # of the first ``op`` of the new mode, ns
    mode: str  # ``unaware``, ``embedding``, ``inversion`` or ``hold``
    model: str = ""  # of the valves that it works with, as the controller names it
    reason: str = ""  # why it changed
    frictions: Mapping[str, float] = dataclasses.field(default_factory=dict)  # by ``V1.f_s``, %


@dataclasses.dataclass(frozen=True)
class Fit:
    """One fit of the estimator."""

    stamp: int  # end of the window, ns
    identification: Mapping[str, Any]  # the mapping of ``identify --json`` without ``record``
    trusted: Mapping[str, float]  # friction trusted after this fit, by ``V1.f_s``, %

    def friction(self, valve: str, key: str) -> tuple[float, float, float]:
        """Return ``f_s`` or ``f_d`` of a valve and the ends of its interval, %; NaN for none."""
        told = (one for one in self.identification.get("valves", ()) if one.get("name") == valve)
        found: Mapping[str, Any] = next(told, {})
        figures = (found.get(key), *(found.get(f"{key}_interval") or (None, None)))
        value, low, high = (math.nan if one is None else float(one) for one in figures)
        return value, low, high


@dataclasses.dataclass(frozen=True)
class Text:
    """A string that a node published: its topic, log time in ns and content."""

    topic: str
    log_time: int
    text: str


@dataclasses.dataclass(frozen=True)
class GapLog:
    """What the monitor told, by the end of its window in ns."""

    looks: Mapping[int, Mapping[str, Any]]  # documents of the measurements
    findings: Mapping[int, Mapping[str, Any]]  # documents of what the workflow found


def of_loop(messages: Iterable[BagMessage], space: str) -> list[BagMessage]:
    """Return the messages of the loop in the namespace ``space``.

    Of the diagnostics, a topic that loops share, the statuses of the loop's own nodes are kept.
    """
    kept = []
    for message in messages:
        namespace, name = last_part(message.topic)
        if name == "diagnostics":
            header, every = message.message.header, message.message.status
            own = [s for s in every if last_part("/" + node_of(s))[0] == space]
            only = types.SimpleNamespace(header=header, status=own)
            kept.append(dataclasses.replace(message, message=only))
        elif (last_part(namespace)[0] if name == "config" else namespace) == space:
            kept.append(message)
    return kept


def node_of(status: Any) -> str:
    """Return the node that gave a diagnostic status: what stands before the colon."""
    return str(status.name).partition(":")[0].strip()


def mode_changes(messages: Iterable[BagMessage]) -> tuple[ModeChange, ...]:
    """Return the changes of mode, model or friction in ``/diagnostics``, with swap times."""
    return without_repeats(
        ModeChange(
            stamp,
            values["mode"],
            values.get("model", ""),
            values.get("reason", ""),
            _frictions(values, "."),
        )
        for stamp, _, values in _statuses(messages)
        if "mode" in values
    )


def without_repeats(changes: Iterable[ModeChange]) -> tuple[ModeChange, ...]:
    """Drop changes that change neither mode nor model nor friction."""
    kept: list[ModeChange] = []
    for change in changes:
        force = (change.mode, change.model, change.frictions)
        if not kept or force != (kept[-1].mode, kept[-1].model, kept[-1].frictions):
            kept.append(change)
    return tuple(kept)


def fits(messages: Iterable[BagMessage]) -> tuple[Fit, ...]:
    """Return the fits that ``/diagnostics`` tells, by the end of their window."""
    found: dict[int, Fit] = {}
    for end, values, identification in documents(messages, "identification"):
        found[end] = Fit(end, identification, _frictions(values, ".trusted_"))
    return tuple(found[end] for end in sorted(found))


def gap_log(messages: Iterable[BagMessage]) -> GapLog:
    """Return what the diagnostics among ``messages`` tell of the monitor, in order of time."""
    told = list(messages)
    looks, findings = (
        dict(sorted((end, document) for end, _, document in documents(told, kind)))
        for kind in ("look", "finding")
    )
    return GapLog(looks, findings)


def answer_times(messages: Iterable[BagMessage]) -> dict[str, float]:
    """Return the last p50, p99, p999 and max of the times from PV to OP, ms; empty in lockstep."""
    found: dict[str, float] = {}
    for _, _, told in _statuses(messages):
        with contextlib.suppress(KeyError, ValueError):
            values = {name: float(told[f"pv_to_op_ms_{name}"]) for name in FIGURES}
            found = values if all(map(math.isfinite, values.values())) else found
    return found


def stem_estimate(messages: Iterable[BagMessage], record: Record, start: int) -> FloatArray | None:
    """Return the stem positions, shape (N, m), in the first points on ``prediction``.

    The ``record`` has no gaps and begins at stamp ``start``, ns; NaN stands where a sample has no
    prediction.
    """
    found = np.full((len(record), len(record.valves)), np.nan)
    told = False
    for message in on_topic(messages, _TRAJECTORY, "prediction"):
        plan = message.message
        if not plan.points:
            continue
        told = True
        row = round((stamp_ns(plan) - start) / 1e9 / record.sample_time)
        first = dict(zip(plan.joint_names, plan.points[0].positions, strict=False))
        if 0 <= row < len(record):
            found[row] = [float(first.get(name, np.nan)) for name in record.valves]
    return found if told else None


def _frictions(values: Mapping[str, str], mark: str) -> dict[str, float]:
    """Return ``V1.f_s`` → value from keys such as ``V1.f_s`` or ``V1.trusted_f_s``."""
    found = {}
    for key, value in values.items():
        valve, dot, name = key.rpartition(mark)
        if not (valve and dot and name) or name.startswith("trusted_"):
            continue
        with contextlib.suppress(ValueError):
            found[f"{valve}.{name}"] = float(value)
    return found


def swap_of(changes: Iterable[ModeChange], before: str = "") -> ModeChange | None:
    """Return the first change from ``unaware`` to a mode that knows of the friction."""
    for change in changes:
        if before == "unaware" and change.mode in ("embedding", "inversion"):
            return change
        before = change.mode
    return None


def mode_texts(messages: Iterable[BagMessage]) -> tuple[ModeChange, ...]:
    """Return the changes on ``mode``, whose messages bear no stamp: log times stand in."""
    return without_repeats(
        ModeChange(text.log_time, text.text, reason="time of reception")
        for text in texts(messages, "mode")
    )


def texts(messages: Iterable[BagMessage], name: str) -> tuple[Text, ...]:
    """Return the strings on topics whose last part is ``name``."""
    return tuple(
        Text(message.topic, message.log_time, str(message.message.data))
        for message in on_topic(messages, STRING, name)
    )


def published_counts(messages: Iterable[BagMessage]) -> dict[str, int]:
    """Return how many messages of each topic the nodes say they published.

    The keys are ``published:<topic>`` (or with a space); of one node, named before the
    colon in the status name, the last count holds; several nodes on a topic add up.
    """
    last: dict[tuple[str, str], int] = {}
    for _, node, values in _statuses(messages):
        for key, value in values.items():
            if key.startswith(("published:", "published ")) and value.isdecimal():
                last[node, key[len("published:") :].strip()] = int(value)
    totals: Counter[str] = Counter()
    for (_, topic), count in last.items():
        totals[topic] += count
    return dict(totals)


def tells_of_run(topic: BagTopic) -> bool:
    """Tell whether a topic says something of the run besides its signals."""
    name = last_part(topic.name)[1]
    return (topic.type, name) in {
        (JOINT_STATE, "stiction"),
        (DIAGNOSTICS, "diagnostics"),
        (_TRAJECTORY, "prediction"),
        (STRING, "mode"),
        (STRING, "loop_model"),
        (STRING, "config"),
    }


def _statuses(messages: Iterable[BagMessage]) -> Iterator[tuple[int, str, Mapping[str, str]]]:
    """Yield stamp in ns, node and keys of each status in ``/diagnostics``."""
    for message in on_topic(messages, DIAGNOSTICS, "diagnostics"):
        for status in message.message.status:
            values = {str(item.key): str(item.value) for item in status.values}
            yield stamp_ns(message.message), node_of(status), values


def documents(
    messages: Iterable[BagMessage], key: str
) -> Iterator[tuple[int, Mapping[str, str], Mapping[str, Any]]]:
    """Yield the end of a window, all keys of its status, and the JSON that stands under one."""
    for _, _, values in _statuses(messages):
        end = values.get("window_end", "")
        try:
            document = json.loads(values.get(key, ""))
        except json.JSONDecodeError:
            continue
        if end.isdecimal() and isinstance(document, dict):
            yield int(end), values, document


def on_topic(messages: Iterable[BagMessage], type_name: str, name: str) -> Iterable[BagMessage]:
    """Return the messages of a type on topics whose last part is ``name``."""
    return (m for m in messages if m.type == type_name and last_part(m.topic)[1] == name)
