"""The report of a loop that was bridged to a control system: who had the valves, and when."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.pages.frame import framed
from stiction_ros.records.bag.messages import BagMessage, last_part, read_messages, stamp_ns
from stiction_ros.records.run.log import RunLog, read_run
from stiction_ros.records.storage.bag_metadata import BagTopic
from stiction_ros.report.drawing import (
    BLUE,
    GREEN,
    GREY,
    INK,
    VERMILION,
    Drawing,
    TimeAxis,
    data_limits,
    legend,
    mark_swap,
    panels,
    style,
)
from stiction_ros.report.page import card, duration, embedded, number, table
from stiction_ros.report.run.scoring import Phases, phases
from stiction_ros.report.run.summary import measured, messages, write_json
from stiction_ros.report.run.work_table import work_rows
from stiction_ros.texts import finite
from stiction_studies.control_system.journal import transfer_steps

JOURNAL = "journal.jsonl"  # of the simulated plant, beside the bag
SMOOTH = 1.0  # %: what OP may step by at a transfer of control
GONE = 0.2  # share of the amplitude before that a cycle that is gone may still have


@dataclasses.dataclass(frozen=True)
class GrantChange:
    """The grant from a sample on."""

    stamp: int
    state: str
    reason: str


@dataclasses.dataclass(frozen=True)
class Transfer:
    """Control passed from one to the other.

    Attributes:
        time: s since the first sample.
        to: ``remote`` or ``plant``.
        reason: as the bridge told it.
        step: largest step of OP from the last sample of the one to the first of the other, %.
    """

    time: float
    to: str
    reason: str
    step: float


@dataclasses.dataclass(frozen=True)
class BridgedRun:
    """What the bag of a bridged loop tells.

    Attributes:
        log: the run itself.
        grants: every change, in order.
        stamps, applied: OP in force, ns and %, shapes (K,) and (K, m).
        names: of the valves.
    """

    log: RunLog
    grants: tuple[GrantChange, ...]
    stamps: np.ndarray[Any, Any]
    applied: FloatArray
    names: tuple[str, ...]

    def transfers(self) -> list[Transfer]:
        """Return every transfer of control."""
        found, held = [], False
        for change in self.grants:
            granted = change.state == "granted"
            if granted == held:
                continue
            held = granted
            k = int(np.searchsorted(self.stamps, change.stamp))
            first = k - granted  # the first OP written is that in force; the PIs begin a scan later
            pair = self.applied[max(first, 0) : first + 2]
            step = float(np.abs(np.diff(pair, axis=0)).max()) if len(pair) > 1 else 0.0
            to = "remote" if granted else "plant"
            found.append(Transfer(self.log.seconds(change.stamp), to, change.reason, step))
        return found


def read_bridged(bag: str | Path) -> BridgedRun:
    """Read a bag with ``op_applied`` and the grants on ``/diagnostics``.

    Raises:
        InputError: as :func:`stiction_ros.records.run.log.read_run`.
    """
    log = read_run(bag)
    grants: list[GrantChange] = []
    applied: dict[int, Sequence[float]] = {}
    names: tuple[str, ...] = ()
    for message in read_messages(bag, wanted=_tells):
        if last_part(message.topic)[1] == "op_applied":
            names = tuple(message.message.name)
            applied[stamp_ns(message.message)] = list(message.message.position)
        else:
            grants += _grants(message)
    stamps = np.array(sorted(applied))
    rows = np.array([applied[int(stamp)] for stamp in stamps]).reshape(len(stamps), len(names))
    return BridgedRun(log, tuple(grants), stamps, rows, names)


def _tells(topic: BagTopic) -> bool:
    return last_part(topic.name)[1] in ("op_applied", "diagnostics")


def _grants(message: BagMessage) -> list[GrantChange]:
    found = []
    for status in message.message.status:
        if ": grant " in status.name:
            told = {item.key: item.value for item in status.values}
            state, reason = told.get("grant", ""), told.get("reason", "")
            found.append(GrantChange(stamp_ns(message.message), state, reason))
    return found


def report_opcua(
    bag: str | Path, out: Path, round_samples: int, seconds: float
) -> Mapping[str, Any]:
    """Write ``report.html``, ``summary.json`` and the figure; return the summary.

    Args:
        bag: of the run.
        out: folder.
        round_samples: of one round of the set-points.
        seconds: wall time of the run.
    """
    run = read_bridged(bag)
    record, transfers = run.log.record, run.transfers()
    steps = journal_steps(out / JOURNAL)
    if len(steps) == len(transfers):  # the plant itself knows it to the write
        pairs = zip(transfers, steps, strict=True)
        transfers = [dataclasses.replace(one, step=step) for one, step in pairs]
    granted = next((one for one in transfers if one.to == "remote"), None)
    at = None if granted is None else round(granted.time / record.sample_time)
    found = phases(record, at, round_samples)
    failure = _failure(found, transfers)
    summary = {
        "scenario": "opcua",
        "status": "failed" if failure else "ok",
        "reason": failure,
        "samples": len(record),
        "seconds": seconds,
        "swap_time": None if run.log.swap is None else run.log.seconds(run.log.swap.stamp),
        "friction": dict(run.log.swap.frictions) if run.log.swap is not None else {},
        "transfers": [dataclasses.asdict(one) for one in transfers],
        "grants": [
            {"time": run.log.seconds(one.stamp), "state": one.state, "reason": one.reason}
            for one in run.grants
        ],
        **measured({"before": found.before, "after": found.after}),
        "messages": messages(run.log.published, run.log.recorded),
        "notes": list(run.log.notes),
    }
    summary["story"] = _story(summary, found)
    drawing = draw_bridged(run, transfers)
    drawing.save(out)
    (out / "report.html").write_text(_page(summary, drawing), encoding="utf-8")
    told = dict(finite(summary))
    write_json(told, out / "summary.json")
    return told


def journal_steps(path: Path) -> list[float]:
    """Return the step of OP at each transfer, %, from the journal of a simulated plant.

    Empty without a journal.
    """
    if not path.is_file():
        return []
    lines = path.read_text(encoding="utf-8").splitlines()
    return transfer_steps(json.loads(line) for line in lines)


def _failure(found: Phases, transfers: Sequence[Transfer]) -> str:
    """Return why the run does not show what it should; empty when it does."""
    if [one.to for one in transfers] != ["remote", "plant"]:
        return f"control was not granted and taken back once: {[one.to for one in transfers]}"
    rough = max(one.step for one in transfers)
    if rough > SMOOTH:
        return f"OP stepped by {rough:.2f} % at a transfer of control"
    if found.reason or found.before is None or found.after is None:
        return found.reason or "the two phases cannot be compared"
    for name, before in found.before.scores.items():
        after = found.after.scores[name]
        cycled = name == next(iter(found.before.scores))
        if cycled and (after.amplitude or 0.0) > GONE * (before.amplitude or 0.0):
            return f"{name} goes on cycling after the grant"
    return ""


def _story(summary: Mapping[str, Any], found: Phases) -> list[str]:
    lines = []
    if summary["swap_time"] is not None:
        friction = ", ".join(f"{key} {value:.2f}" for key, value in summary["friction"].items())
        lines.append(f"friction found, controller swapped at {duration(summary['swap_time'])}")
        lines[-1] += f" ({friction})" if friction else ""
    for one in summary["transfers"]:
        who = "granted to the controller" if one["to"] == "remote" else "back with the plant"
        lines.append(
            f"{duration(one['time'])}: {who} ({one['reason']}), OP stepped by {one['step']:.2f} %"
        )
    if found.before is not None and found.after is not None:
        for name, before in found.before.scores.items():
            after = found.after.scores[name]
            lines.append(
                f"{name}: amplitude {number(before.amplitude)} before, "
                f"{number(after.amplitude)} under the grant"
            )
    if summary["reason"]:
        lines.append(f"failed: {summary['reason']}")
    return lines


def draw_bridged(run: BridgedRun, transfers: Sequence[Transfer]) -> Drawing:
    """Draw PV, SP and OP in force; a band shows when OP was written by the controller."""
    record = run.log.record
    time = TimeAxis.spanning(record.time[-1])
    rows = len(record.outputs) + len(run.names)
    with style():
        figure, axes = panels(rows, 0.6 + 1.8 * rows, sharex=True)
        axes = axes[:, 0]
        for i, name in enumerate(record.outputs):
            axes[i].plot(time(record.time), record.pv[:, i], color=BLUE, label="PV")
            if record.sp is not None:
                axes[i].plot(time(record.time), record.sp[:, i], color=INK, label="SP")
            axes[i].set_title(name)
            data_limits(axes[i], [record.pv[:, i]])
        seconds = (run.stamps - run.log.start) / 1e9
        for j, name in enumerate(run.names):
            axis = axes[len(record.outputs) + j]
            axis.plot(time(seconds), run.applied[:, j], color=VERMILION, label="OP in force")
            axis.set_title(name)
            axis.set_ylabel("%")
        end = float(record.time[-1])
        for k, one in enumerate(transfers):
            until = transfers[k + 1].time if k + 1 < len(transfers) else end
            for axis in axes:
                if one.to == "remote":
                    axis.axvspan(time(one.time), time(until), color=GREEN, alpha=0.12)
                mark_swap(axis, float(time(one.time)))
            mark_swap(axes[0], float(time(one.time)), f"to the {one.to}")
        swap = run.log.swap
        if swap is not None:
            axes[0].axvline(time(run.log.seconds(swap.stamp)), color=GREY, linestyle=":")
        legend(axes[1])
        axes[-1].set_xlabel(time.label)
        axes[-1].set_xlim(0.0, float(time(end)))
    caption = (
        "Outside the band the plant's own PIs have the valves, within it OP is written under the "
        "operator's grant. The dotted line is the swap to a controller that knows of the friction."
    )
    return Drawing("control", "Who had the valves", caption, figure)


def _page(summary: Mapping[str, Any], drawing: Drawing) -> str:
    good = summary["status"] == "ok"
    parts = [
        "<h1>A loop bridged by OPC UA</h1>",
        f'<p class="soft">{summary["samples"]} samples in {duration(summary["seconds"])}</p>',
        '<div class="cards">',
        card(
            "good" if good else "bad",
            "control",
            "granted and taken back" if good else "not as it should be",
            summary["reason"] or "the operator had the last word",
        ),
    ]
    if summary["friction"]:
        shown = ", ".join(f"{key} {value:.2f} %" for key, value in summary["friction"].items())
        parts.append(card("good", "friction", shown, f"at {duration(summary['swap_time'])}"))
    for one in summary["transfers"]:
        smooth = "good" if one["step"] <= SMOOTH else "bad"
        parts.append(
            card(smooth, f"to the {one['to']}", f"{one['step']:.2f} % step of OP", one["reason"])
        )
    parts += ["</div>", embedded(drawing), "<h2>The loop</h2>"]
    rows = [
        (name, key, *(number(summary["phases"][p][name][key]) for p in ("before", "after")))
        for name in summary["phases"].get("before", {})
        for key in ("amplitude", "offset", "iae_per_hour")
        if "after" in summary["phases"]
    ]
    rows += [
        (valve, label, *(number(value) for value in told))
        for valve, label, told in work_rows(summary, ("before", "after"))
    ]
    parts.append(table(("output", "", "plant's PIs", "under the grant"), rows, 2))
    parts.append("<h2>The handshake</h2>")
    told = [(duration(one["time"]), one["state"], one["reason"]) for one in summary["grants"]]
    parts.append(table(("time", "grant", "reason"), told, 3))
    return framed("A loop bridged by OPC UA", parts)
