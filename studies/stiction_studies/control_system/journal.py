"""What the simulated plant has noted of remote operation, held against what is allowed."""

import dataclasses
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_studies.control_system.control_system import AUTO

JITTER = 0.02  # s by which the journal's clock may differ from when an OP came
SLACK = 1e-6  # %
UNDER_WAY = 0.5  # s that an OP may be under way when the operator takes control back


@dataclasses.dataclass(frozen=True)
class Allowed:
    """What remote OPs may do."""

    # low, high: limits, %
    low: float
    high: float
    rate: float  # largest change, % per second of the plant's time
    sample_time: float  # s of the plant's time; no change may be larger than that of a sample
    speed: float  # seconds of the plant per second


@dataclasses.dataclass(frozen=True)
class Written:
    """What was written, by the plant's own journal."""

    taken: int  # remote OPs that were taken
    ungranted: int  # of these, those that no mode granted
    # OPs that the plant refused as no mode granted them, but for those that were under way
    # when it changed
    refused: int
    denied: int  # tags that a user had no right to write
    beyond: float  # furthest that an OP was beyond limits or rate, %
    steps: tuple[float, ...]  # of OP at each transfer of control, %
    modes: tuple[tuple[str, float], ...]  # every mode with the wall time at which it began, s


def written(events: Iterable[Mapping[str, Any]], allowed: Allowed) -> Written:
    """Hold a journal against what is allowed."""
    told = list(events)
    counts = Counter(one["event"] for one in told)
    mode, last = AUTO, None
    beyond, ungranted, refused = 0.0, 0, 0
    modes: list[tuple[str, float]] = []
    for one in told:
        if one["event"] == "mode":
            mode, last = one["mode"], None
            modes.append((mode, one["wall"]))
        elif one["event"] == "op":
            op = np.array(one["op"], dtype=float)
            ungranted += mode == AUTO or not one["taken"]
            beyond = max(beyond, _excess(op, one["wall"], last, allowed))
            last = op, one["wall"]
        elif one["event"] == "refused":
            refused += not modes or one["wall"] - modes[-1][1] > UNDER_WAY
    return Written(
        counts["op"],
        ungranted,
        refused,
        counts["denied"],
        beyond,
        tuple(transfer_steps(told)),
        tuple(modes),
    )


def _excess(
    op: FloatArray, wall: float, last: tuple[FloatArray, float] | None, allowed: Allowed
) -> float:
    """Return how far an OP is beyond what is allowed, %; inf for one that is no number."""
    if not np.isfinite(op).all():
        return math.inf
    over = float(np.maximum(op - allowed.high, allowed.low - op).max())
    if last is not None:
        before, at = last
        sample = allowed.rate * allowed.sample_time
        spent = allowed.rate * allowed.speed * (wall - at + JITTER)
        over = max(over, float(np.abs(op - before).max()) - min(sample, spent))
    return max(over - SLACK, 0.0)


def transfer_steps(events: Iterable[Mapping[str, Any]]) -> list[float]:
    """Return the step of OP at each transfer, %.

    It is that from the last OP in force before the mode changed to the first that the new one
    gave: the first OP written, or the first scan of the plant's PIs, which may be the one that
    has changed the mode.
    """
    found: list[float] = []
    mode, before, scan, waiting = AUTO, None, 0, False
    for event in events:
        if event["event"] == "mode" and event["mode"] != mode:
            mode, waiting, scan = event["mode"], before is not None, event["sample"]
        elif event["event"] in ("op", "out"):
            op = np.array(event[event["event"]])
            if mode != AUTO:
                given = event["event"] == "op"
            else:
                given = event["sample"] > scan or bool(waiting and (op != before).any())
            if waiting and given:
                found.append(float(np.abs(op - before).max()))
                waiting = False
            if not waiting:
                before = op
    return found
