"""The verdict of a valve test."""

import dataclasses
import math
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.identification.evidence.sensor_hold import held_rows
from stiction_ros.identification.result import VerdictKind
from stiction_ros.identification.valve_test.frictions import SMALLEST, Frictions
from stiction_ros.identification.valve_test.likelihood import OWN_ERROR, log_sum
from stiction_ros.identification.valve_test.search import Explanation, Trial
from stiction_ros.identification.valve_test.steps import FEWEST, SHORTEST, Steps

DECIDED = 0.95
"""Probability from which on a verdict is given, either way."""
STOPS = 0.995
"""Probability at which a test that goes on ends: one of two hundred ends wrongly, as many again may
where no move is left, and all from :data:`DECIDED` on count."""
NO_LINK = 0.1
"""Prior of a PV that OP does not move at all: a wrong tag, a bypass. The rest is shared evenly by
friction and none, as only loops whose record left that open are tested."""
INTERVAL = (0.025, 0.975)
"""Shares of the posterior below the ends of an interval."""


@dataclasses.dataclass(frozen=True)
class Judgement:
    """What a test says of the valve so far."""

    verdict: VerdictKind  # sticky, backlash, healthy or undecided
    # of friction of interest: of ``SMALLEST`` or more, and such that a slip of f_S moves PV by more
    # than its noise, which hides the cycles of less
    probability: float
    f_s: float  # f_s, f_d: median, %; 0 for a valve without friction
    f_s_interval: tuple[float, float]  # f_s_interval, f_d_interval: 95 % of what is possible, %
    f_d: float
    f_d_interval: tuple[float, float]
    responded: bool  # whether PV surely answered OP at all
    moves_seen: int  # steps of OP in the record
    weights: FloatArray  # how likely each friction is, shape (G,)
    counts: BoolArray  # whether it is of interest, shape (G,)
    trial: Trial  # trial, ideal, sticky, frictions: what it was read from
    ideal: Explanation
    sticky: Explanation
    frictions: Frictions

    @property
    def decided(self) -> bool:
        """Whether there is a verdict."""
        return self.verdict is not VerdictKind.UNDECIDED

    @property
    def sure(self) -> bool:
        """Whether a test that goes on may end."""
        return self.decided and not 1.0 - STOPS < self.probability < STOPS

    @property
    def known_to(self) -> float:
        """Half the widths of the intervals of f_S and f_D together, over f_S; 0 where none is."""
        if not self.verdict.has_friction:
            return 0.0
        return 0.5 * float(np.ptp(self.f_s_interval) + np.ptp(self.f_d_interval)) / self.f_s

    @property
    def gain(self) -> float:
        """What 1 % of the stem makes of PV within a hold by the likelier explanation."""
        best, row = self.ideal, 0
        if self.probability > 0.5:
            best, row = self.sticky, int(self.frictions.which[np.argmax(self.weights)])
        return float(best.shown(self.trial.hold)[row])

    @property
    def sentence(self) -> str:
        """What is said of the valve, in a sentence or two."""
        sure = f"{100.0 * max(self.probability, 1.0 - self.probability):.1f} %"
        low, high = self.f_s_interval
        if self.verdict is VerdictKind.HEALTHY:
            return (
                f"Healthy, with probability {sure}: the stem follows OP, without friction of "
                f"{high:.2g} % or more."
            )
        if not self.decided:
            reach = float(np.ptp(self.trial.steps.levels))
            if not self.responded:
                return (
                    f"Undecided: PV does not surely answer OP, which went over {reach:.3g} %. More "
                    "friction than that holds the stem, noise hides the answer, or PV is not that "
                    "of this valve."
                )
            return (
                f"Undecided: friction is {100.0 * self.probability:.0f} % likely, f_S up to "
                f"{high:.3g} %."
            )
        rests = (
            f"with probability {sure}: the stem rests until OP leads it by f_S, "
            f"{low:.3g} to {high:.3g} %"
        )
        if self.verdict is VerdictKind.BACKLASH:
            return f"Backlash, {rests}, and then follows without a jump."
        return f"Sticky, {rests}."

    def to_dict(self) -> dict[str, Any]:
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


def measured_enough(pv: FloatArray, moves: int) -> bool:
    """Tell whether more values of PV, shape (N,), were measured than the explanations can take up.

    They take up :data:`SHORTEST` by process and noise, and one by each move of OP.
    """
    return int((~held_rows(pv)).sum()) > SHORTEST + moves


def judged(op: FloatArray, pv: FloatArray, gain: float | None = None) -> Judgement:
    """Return the verdict on a test.

    Args:
        op: that moves by steps, %, shape (N,).
        pv: engineering units, shape (N,).
        gain: what 1 % of the stem makes of PV within a hold, where that was known before.
    """
    trial = Trial(pv, ~held_rows(pv), Steps.of(op), gain)
    ideal, still, sticky, frictions = trial.explained()
    share = 0.5 * (1.0 - NO_LINK)
    logs = np.array([ideal.evidence, sticky.evidence, still.evidence])
    logs += np.log([share, share, NO_LINK])
    _, friction, no_link = np.exp(logs - log_sum(logs)).tolist()
    cells = sticky.cells(frictions)
    weights = friction * cells
    hidden = sticky.hidden(trial.hold)[frictions.which]
    counts = ~frictions.moved | (frictions.static >= hidden)
    probability = float(weights[counts].sum())
    moved = 1.0 - no_link - float(weights[~frictions.moved].sum())
    verdict = VerdictKind.UNDECIDED
    enough = len(trial.steps.rows) >= FEWEST
    if enough and 1.0 - no_link - probability >= DECIDED:
        verdict = VerdictKind.HEALTHY
    elif enough and probability >= DECIDED:
        even = float(cells[frictions.even].sum())
        verdict = VerdictKind.BACKLASH if even >= DECIDED else VerdictKind.STICKY
    static = _spread(frictions.static, cells, frictions.even)
    dynamic = _spread(np.maximum(frictions.dynamic, 0.0), cells, frictions.even)
    low, high = bracket(trial.steps, frictions, cells)
    own = 2.0 * OWN_ERROR  # two standard deviations of what the law leaves out
    static = max(min(static[0], low) - own, 0.0), static[1], max(static[2], high) + own
    if verdict is VerdictKind.HEALTHY:
        static = dynamic = (0.0, 0.0, max(SMALLEST, float(ideal.hidden(trial.hold)[0])))
    elif verdict is VerdictKind.UNDECIDED:
        static, dynamic = (0.0, *static[1:]), (0.0, *dynamic[1:])
    return Judgement(
        verdict,
        probability,
        static[1],
        (static[0], static[2]),
        dynamic[1],
        (dynamic[0], dynamic[2]),
        moved >= DECIDED,
        len(trial.steps.rows),
        weights,
        counts,
        trial,
        ideal,
        sticky,
        frictions,
    )


def _spread(values: FloatArray, weights: FloatArray, even: BoolArray) -> tuple[float, float, float]:
    """Return low end, median and high end of what is possible, with a jump or without.

    Args:
        values: of each cell, shape (G,).
        weights: how likely each is, shape (G,).
        even: whether it is without a jump, shape (G,).
    """
    shares = float(weights[even].sum()), float(weights[~even].sum())
    parts = [
        _quantiles(values[part], weights[part])
        for part, share in zip((even, ~even), shares, strict=True)
        if share > (1.0 - DECIDED) * sum(shares)
    ]
    middle = _quantiles(values, weights)[1]
    return min(part[0] for part in parts), middle, max(part[2] for part in parts)


def _quantiles(values: FloatArray, weights: FloatArray) -> tuple[float, float, float]:
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
