"""The steps of OP in manual that would decide on a valve, bounded in OP and PV."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import ndtr

from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.valve_test.frictions import LARGEST, SMALLEST
from stiction_ros.identification.valve_test.judgement import DECIDED, Judgement
from stiction_ros.identification.valve_test.likelihood import CURVATURE, KNOWN, OWN_ERROR, Shape
from stiction_ros.identification.valve_test.search import UNSHOWN, Explanation, Trial
from stiction_ros.identification.valve_test.steps import Steps
from stiction_ros.texts import spoken

CLEAR = 4.0
"""Standard deviations of PV's noise that the answer to the first pair makes, where it may."""
WIDENS = 2.5
"""Times by which a pair is wider than the one before: five go from the smallest friction of
interest to the largest."""
SIZES = 12  # of pairs that a further round is chosen from
PAIRS = 3  # of a round that is made by hand


@dataclasses.dataclass(frozen=True)
class Facts:
    """What is known of a loop before a round of its test."""

    valve: str  # tag
    op: float  # op, pv: where the test begins, % and engineering units
    pv: float
    # what 1 % of the stem makes of PV within a hold, engineering units, sign included; None where
    # it is not known
    gain: float | None
    noise: float  # standard deviation of the mean of PV over a hold, same units
    dead: float  # time after which PV begins to answer, s
    hold: float  # s between two moves
    op_limit: float  # how far OP may go from ``op``, %
    pv_limit: tuple[float, float]  # lowest and highest PV, engineering units

    @property
    def widest(self) -> float:
        """How far OP may go from its start without PV passing its limit, %."""
        most = min(self.op_limit, LARGEST)
        if not self.gain:
            return most
        low, high = self.pv_limit
        return min(most, max(min(high - self.pv, self.pv - low), 0.0) / abs(self.gain))

    def within(self, op: float | None, pv: float | None) -> "Facts":
        """Return the same where OP, %, and PV may go this far from their start; None as before."""
        op_limit = self.op_limit if op is None else op
        pv_limit = self.pv_limit if pv is None else (self.pv - pv, self.pv + pv)
        return dataclasses.replace(self, op_limit=op_limit, pv_limit=pv_limit)


@dataclasses.dataclass(frozen=True)
class Plan:
    """One round of a test."""

    facts: Facts  # of the loop
    levels: tuple[float, ...]  # OP after each move, %; the last is where it began

    @property
    def duration(self) -> float:
        """Seconds from the first move until the last has been held."""
        return self.facts.hold * len(self.levels)

    @property
    def reach(self) -> float:
        """How far OP goes from its start, %."""
        return max(abs(level - self.facts.op) for level in self.levels)

    @property
    def pv_move(self) -> float | None:
        """How far PV goes from its start with an ideal valve, engineering units."""
        return None if self.facts.gain is None else abs(self.facts.gain) * self.reach

    @property
    def sentence(self) -> str:
        """What is done, in one sentence."""
        facts = self.facts
        levels = ", ".join(f"{level:.4g}" for level in self.levels)
        return (
            f"In manual, move OP of {facts.valve} to {levels} %, each held for "
            f"{spoken(facts.hold)}; return it to {facts.op:.4g} % at once where PV leaves "
            "{:.4g} to {:.4g}.".format(*facts.pv_limit)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``valve-test plan --json``."""
        facts = self.facts
        return {
            "valve": facts.valve,
            "start": {"op": facts.op, "pv": facts.pv},
            "moves": [{"after": i * facts.hold, "op": op} for i, op in enumerate(self.levels)],
            "duration": self.duration,
            "pv_limit": list(facts.pv_limit),
            "return_op": facts.op,
            "expected": {"pv_move": self.pv_move, "decides_above": SMALLEST},
            "sentence": self.sentence,
        }


def first_round(facts: Facts) -> Plan:
    """Return the first round: the smallest pairs whose answer PV's noise does not hide."""
    seen = 0.5 * CLEAR * facts.noise / abs(facts.gain) if facts.gain else 0.0
    return _round(facts, max(SMALLEST, seen), PAIRS)


def further_round(facts: Facts, judgement: Judgement, pairs: int = PAIRS) -> Plan | None:
    """Return the next round: the pairs that tell most, or wider ones where PV did not answer.

    The round keeps PV within its limits with probability :data:`DECIDED`, by all that the test
    leaves possible; of rounds that tell as much it is the smallest. Where friction is sure to be
    there, it is to tell its size. It begins where the test began.

    Returns:
        None where the limits leave no such round.
    """
    steps = judgement.trial.steps
    reach, most = steps.reach, min(facts.op_limit, LARGEST)
    facts = dataclasses.replace(facts, op=float(steps.levels[0]))
    if judgement.responded:
        facts = dataclasses.replace(facts, gain=judgement.gain)
        reaches = np.geomspace(0.5 * SMALLEST, max(most, SMALLEST), SIZES)
    else:
        reaches = np.geomspace(WIDENS, 1.0, SIZES, endpoint=False) * reach
    told: dict[float, Plan] = {}
    for least in np.minimum(reaches, most).tolist():
        plan = _round(facts, least, pairs)
        if stays(facts, judgement, plan.levels[:-1]):
            value = _first(plan)
            if judgement.responded:
                value = Forecast.of(judgement, plan.levels[:-1]).apart(judgement.sure)
            told[value] = plan
    enough = DECIDED * max(told, default=0.0)
    best = min((plan for value, plan in told.items() if value >= enough), key=_first, default=None)
    return best if best and (judgement.responded or _first(best) > reach) else None


def stays(facts: Facts, judgement: Judgement, levels: Sequence[float]) -> bool:
    """Return whether PV stays within its limits with probability :data:`DECIDED`.

    Before PV has answered the gain bounds the round: how far a stem that is stuck jumps when it
    breaks loose does not depend on how far OP goes beyond that.
    """
    if not judgement.responded:
        return True
    return Forecast.of(judgement, levels).beyond(*facts.pv_limit) <= 1.0 - DECIDED


def _first(plan: Plan) -> float:
    return plan.levels[0] - plan.facts.op


def _round(facts: Facts, least: float, pairs: int) -> Plan:
    """Return pairs of moves up and down, which leave a level where it was."""
    reaches = sorted({min(least * WIDENS**k, facts.widest) for k in range(pairs)})
    levels = [facts.op + sign * reach for reach in reaches for sign in (1.0, -1.0)]
    return Plan(facts, (*levels, facts.op))


@dataclasses.dataclass(frozen=True)
class Forecast:
    """PV a dead time after the ends of further holds, by all that a test leaves possible.

    It has then gone farthest.
    """

    pv: FloatArray  # of an ideal valve and under each friction, shape (1 + G, J)
    alike: FloatArray  # the same from now on, by one process for all, which tells stems apart
    weights: FloatArray  # how likely each is, shape (1 + G,)
    counts: FloatArray  # the same of each friction of interest, 0 of others, shape (G,)
    # standard deviation of what is left open of each: where PV is, how the load walks, how the gain
    # changes with the opening, shape (J,)
    spread: FloatArray
    noise: FloatArray  # the same of the mean of PV over each hold, shape (J,)
    known: float  # precision of the gain, over its square, by the test so far

    @classmethod
    def of(cls, judgement: Judgement, levels: Sequence[float]) -> "Forecast":
        """Return it.

        Args:
            judgement: of the test so far.
            levels: OP after each further move, %, shape (J,).
        """
        trial, ideal, sticky = judgement.trial, judgement.ideal, judgement.sticky
        hold, count, ahead = round(trial.hold), len(trial.pv), len(levels)
        shape = Shape.of(sticky.dynamics, trial.hold)
        rows = np.append(trial.steps.rows, count + hold * np.arange(ahead))
        path = np.append(trial.steps.levels, levels)
        ends = hold * np.arange(1, ahead + 1)
        cells = judgement.frictions.along(Steps(rows, path, count + int(ends[-1])))
        to_come = _to_come(sticky, trial, rows, ends)
        pv = np.vstack([np.diff(path), cells.moves[cells.which]]) @ to_come
        pv[1:] *= sticky.gains[judgement.frictions.which][:, None]
        alike = pv.copy()
        alike[0] *= ideal.shown(trial.hold)[0] / max(float(shape.shown(trial.hold)), UNSHOWN)
        pv[0] = ideal.gains[0] * (np.diff(path) @ _to_come(ideal, trial, rows, ends))
        recent = trial.pv[trial.seen][-max(hold // 4, 1) :]
        lead = path[1:] - path[0]
        own = judgement.gain**2 * (OWN_ERROR**2 + (CURVATURE * lead**2) ** 2)
        noise = np.sqrt(sticky.noise**2 * shape.unsure(trial.hold) + own)
        walked = shape.load * (ends + shape.dead) + 1.0 / len(recent)
        return cls(
            recent.mean() + pv,
            alike,
            np.append(1.0 - judgement.weights.sum(), judgement.weights),
            judgement.weights * judgement.counts,
            np.sqrt(sticky.noise**2 * walked + own[-ahead:]),
            noise[-ahead:],
            KNOWN**-2 + float(((judgement.gain * lead / noise)[:-ahead] ** 2).sum()),
        )

    def beyond(self, low: float, high: float) -> float:
        """Return how likely PV is beyond a limit at one of the ends, at least."""
        above = ndtr((self.pv - high) / self.spread) + ndtr((low - self.pv) / self.spread)
        return float(self.weights @ above.max(axis=1))

    def apart(self, sizing: bool) -> float:
        """Return how well PV would tell the frictions, 0 to 1, from an ideal valve or each other.

        One less the Bhattacharyya coefficient of two Gaussians of the same width, on average.
        """
        middle, frictions = self.alike[0], self.alike[1:]
        if sizing:
            middle = self.counts @ frictions / self.counts.sum()
        apart, straight = (frictions - middle) / self.noise, self.alike[0] / self.noise
        energy = (apart**2).sum(axis=1)
        energy -= (apart @ straight) ** 2 / (self.known + straight @ straight)  # another gain
        return float(self.counts @ -np.expm1(-energy / 8.0))


def _to_come(explanation: Explanation, trial: Trial, rows: IntArray, ends: IntArray) -> FloatArray:
    """Return what PV is to show of steps from now until a dead time after each end, (M, J)."""
    shape = Shape.of(explanation.dynamics, trial.hold)
    since = len(trial.pv) - rows[:, None]
    return shape.shown(since + ends + shape.dead) - shape.shown(since)
