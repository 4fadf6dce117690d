"""The report of a loop that was bridged to a control system: who had the valves, and when."""

import dataclasses
import itertools
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from stiction_ros.pages.frame import framed, text
from stiction_ros.pages.plot import SCRIPT
from stiction_ros.pages.signals import UNITS, over_record
from stiction_ros.records.bag.messages import BagMessage, last_part, read_messages, stamp_ns
from stiction_ros.records.run.log import RunLog, read_run
from stiction_ros.report.page import number, table, write_page
from stiction_ros.report.run.scoring import Phases, phases
from stiction_ros.report.run.story import measured, messages
from stiction_ros.texts import finite, spoken
from stiction_studies.control_system.journal import transfer_steps

JOURNAL = "journal.jsonl"  # of the simulated plant, beside the bag
SMOOTH = 1.0  # %: what OP may step by at a transfer of control
GONE = 0.2  # share of the amplitude before that a cycle that is gone may still have


@dataclasses.dataclass(frozen=True)
class GrantChange:
    """The grant from a time on, s since the first sample."""

    time: float
    state: str
    reason: str


@dataclasses.dataclass(frozen=True)
class Transfer:
    """Control passed from one to the other.

    Attributes:
        time: s since the first sample.
        to: ``remote`` or ``plant``.
        reason: as the bridge told it.
        step: largest step of OP from the one to the other, %; NaN where the plant notes another
            number of transfers.
    """

    time: float
    to: str
    reason: str
    step: float


def report_opcua(
    bag: str | Path, out: Path, round_samples: int, seconds: float
) -> Mapping[str, Any]:
    """Write ``report.html`` and ``summary.json``; return the summary.

    Args:
        bag: of the run.
        out: folder, with the plant's journal in it.
        round_samples: of one round of the set-points.
        seconds: wall time of the run.
    """
    log = read_run(bag)
    grants, record = read_grants(bag, log), log.record
    transfers = transfers_of(grants, journal_steps(out / JOURNAL))
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
        "swap_time": None if log.swap is None else log.seconds(log.swap.stamp),
        "friction": dict(log.swap.frictions) if log.swap is not None else {},
        "transfers": [dataclasses.asdict(one) for one in transfers],
        "grants": [dataclasses.asdict(one) for one in grants],
        **measured({"before": found.before, "after": found.after}),
        "messages": messages(log.published, log.recorded),
        "notes": list(log.notes),
    }
    summary["story"] = _story(summary, found)
    told = dict(finite(summary))
    write_page(out, _page(log, summary, transfers), told)
    return told


def read_grants(bag: str | Path, log: RunLog) -> list[GrantChange]:
    """Return every change of the grant that ``/diagnostics`` tell, in order."""

    def changes(message: BagMessage) -> list[GrantChange]:
        time, found = log.seconds(stamp_ns(message.message)), []
        for status in message.message.status:
            if ": grant " in status.name:
                told = {item.key: item.value for item in status.values}
                found.append(GrantChange(time, told.get("grant", ""), told.get("reason", "")))
        return found

    heard = read_messages(bag, wanted=lambda topic: last_part(topic.name)[1] == "diagnostics")
    return [change for message in heard for change in changes(message)]


def transfers_of(grants: Sequence[GrantChange], steps: Sequence[float]) -> list[Transfer]:
    """Return every transfer of control with the step that the plant has noted of it, %."""
    states = [False, *(change.state == "granted" for change in grants)]
    passed = [
        (change, now)
        for change, (before, now) in zip(grants, itertools.pairwise(states), strict=True)
        if now is not before
    ]
    noted = steps if len(steps) == len(passed) else [math.nan] * len(passed)
    return [
        Transfer(change.time, "remote" if now else "plant", change.reason, step)
        for (change, now), step in zip(passed, noted, strict=True)
    ]


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
    if not all(one.step <= SMOOTH for one in transfers):
        steps = ", ".join(f"{one.step:.2f}" for one in transfers)
        return f"OP stepped by {steps} % at the transfers of control"
    if found.reason or found.before is None or found.after is None:
        return found.reason or "the two phases cannot be compared"
    name, before = next(iter(found.before.scores.items()))
    if (found.after.scores[name].amplitude or 0.0) > GONE * (before.amplitude or 0.0):
        return f"{name} goes on cycling after the grant"
    return ""


def _story(summary: Mapping[str, Any], found: Phases) -> list[str]:
    lines = []
    if summary["swap_time"] is not None:
        friction = ", ".join(f"{key} {value:.2f}" for key, value in summary["friction"].items())
        lines.append(f"friction found, controller swapped at {spoken(summary['swap_time'])}")
        lines[-1] += f" ({friction})" if friction else ""
    for one in summary["transfers"]:
        who = "granted to the controller" if one["to"] == "remote" else "back with the plant"
        lines.append(
            f"{spoken(one['time'])}: {who} ({one['reason']}), OP stepped by {one['step']:.2f} %"
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


def _page(log: RunLog, summary: Mapping[str, Any], transfers: Sequence[Transfer]) -> str:
    record = log.record
    ends = [*(one.time for one in transfers[1:]), float(record.time[-1])]
    remote = [
        (one.time, end) for one, end in zip(transfers, ends, strict=False) if one.to == "remote"
    ]
    swap = () if summary["swap_time"] is None else (summary["swap_time"],)
    told = [(spoken(one["time"]), one["state"], one["reason"]) for one in summary["grants"]]
    return framed(
        "A loop bridged by OPC UA",
        [
            "<h1>A loop bridged by OPC UA</h1>",
            f'<p class="soft">{len(record)} samples in {spoken(summary["seconds"])}</p>',
            f"<ul>{''.join(f'<li>{text(line)}</li>' for line in summary['story'])}</ul>",
            "<p>Where it is shaded OP is written under the operator's grant; else the plant's own "
            "PIs have the valves. The dashed line is the swap to a controller that knows of the "
            "friction.</p>",
            *over_record(record, None, UNITS, marks=swap, shade=tuple(remote)),
            "<h2>The handshake</h2>",
            table(("time", "grant", "reason"), told, 3),
        ],
        SCRIPT,
    )
