"""The verdict of a valve test."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.evidence.sensor_hold import held_rows
from stiction_ros.identification.result.identification import VerdictKind
from stiction_ros.identification.valve_test.frictions import SMALLEST, Frictions
from stiction_ros.identification.valve_test.likelihood import log_sum
from stiction_ros.identification.valve_test.search import Explanation, Known, Trial
from stiction_ros.identification.valve_test.steps import Steps

DECIDED = 0.95
"""Probability from which on a verdict is given, either way."""
NO_LINK = 0.1
"""Prior of a PV that OP does not move at all: a wrong tag, a bypass. The rest is shared evenly by
friction and none, as only loops whose record left that open are tested."""
INTERVAL = (0.025, 0.975)
"""Shares of the posterior below the ends of an interval."""


@dataclasses.dataclass(frozen=True)
class Judgement:
    """What a test says of the valve so far.

    Attributes:
        verdict: sticky, backlash, healthy or undecided.
        probability: of friction of :data:`SMALLEST` or more.
        f_s, f_d: median, %; 0 for a valve without friction.
        f_s_interval, f_d_interval: 95 % of what is possible, %.
        responded: whether PV surely answered OP at all.
        moves_seen: steps of OP in the record.
        trial, ideal, sticky, frictions: what it was read from.
    """

    verdict: VerdictKind
    probability: float
    f_s: float
    f_s_interval: tuple[float, float]
    f_d: float
    f_d_interval: tuple[float, float]
    responded: bool
    moves_seen: int
    trial: Trial
    ideal: Explanation
    sticky: Explanation
    frictions: Frictions

    def to_json(self) -> dict[str, Any]:
        """Return the mapping of ``valve-test judge --json`` but for the next moves."""
        return {
            "verdict": self.verdict.value,
            "probability": self.probability,
            "f_s": self.f_s,
            "f_s_interval": list(self.f_s_interval),
            "f_d": self.f_d,
            "f_d_interval": list(self.f_d_interval),
            "responded": self.responded,
            "moves_seen": self.moves_seen,
        }


def judged(op: FloatArray, pv: FloatArray, known: Known | None = None) -> Judgement:
    """Return the verdict on a test.

    Args:
        op: that moves by steps, %, shape (N,).
        pv: engineering units, shape (N,).
        known: before the test; None for nothing.

    Raises:
        InputError: OP does not move as by hand.
    """
    steps = Steps.of(op)
    if why := steps.refusal():
        raise InputError(
            f"is no test in manual: {why}",
            where="OP",
            fix="give a record of OP moved by hand, or let stiction identify judge the loop",
        )
    trial = Trial(pv, ~held_rows(pv), steps, known or Known.of())
    ideal, still, sticky, frictions = trial.explained()
    share = 0.5 * (1.0 - NO_LINK)
    logs = np.array([ideal.evidence, sticky.evidence, still.evidence])
    logs += np.log([share, share, NO_LINK])
    ideal_share, friction, no_link = np.exp(logs - log_sum(logs)).tolist()
    cells = np.exp(sticky.logs - sticky.evidence)
    moved = 1.0 - no_link - friction * float(cells[~frictions.moved].sum())
    verdict = VerdictKind.UNDECIDED
    if ideal_share >= DECIDED:
        verdict = VerdictKind.HEALTHY
    elif friction >= DECIDED:
        even = float(cells[frictions.even].sum())
        verdict = VerdictKind.BACKLASH if even >= DECIDED else VerdictKind.STICKY
    static = _spread(frictions.static, cells)
    dynamic = _spread(np.maximum(frictions.dynamic, 0.0), cells)
    low, high = bracket(trial.steps, frictions, cells)
    static = min(static[0], low), static[1], max(static[2], high)
    if verdict is VerdictKind.HEALTHY:
        static = dynamic = (0.0, 0.0, SMALLEST)
    elif verdict is VerdictKind.UNDECIDED:
        static, dynamic = (0.0, *static[1:]), (0.0, *dynamic[1:])
    return Judgement(
        verdict,
        friction,
        static[1],
        (static[0], static[2]),
        dynamic[1],
        (dynamic[0], dynamic[2]),
        moved >= DECIDED,
        len(trial.steps.rows),
        trial,
        ideal,
        sticky,
        frictions,
    )


def _spread(values: FloatArray, weights: FloatArray) -> tuple[float, float, float]:
    """Return low end, median and high end of what is possible."""
    order = np.argsort(values)
    sums = np.cumsum(weights[order]) / weights.sum()
    rows = np.minimum(np.searchsorted(sums, (INTERVAL[0], 0.5, INTERVAL[1])), len(order) - 1)
    low, middle, high = values[order][rows].tolist()
    return low, middle, high


def bracket(steps: Steps, frictions: Frictions, weights: FloatArray) -> tuple[float, float]:
    """Return the largest lead of OP that did not move the stem, and the smallest that did, %.

    By the likeliest friction; a stem that never moved leaves the second open.
    """
    best = int(np.argmax(weights))
    moves = frictions.moves[frictions.which[best]]
    ups = np.diff(steps.levels)
    lead = frictions.ends[best] - (ups - moves)[::-1].cumsum()[::-1]
    lead = np.abs(lead + ups)
    moved = moves != 0.0
    stayed = float(lead[~moved].max(initial=0.0))
    slipped = float(lead[moved].min(initial=math.inf))
    static = float(frictions.static[best])
    return min(stayed, static), max(slipped, static) if math.isfinite(slipped) else static
