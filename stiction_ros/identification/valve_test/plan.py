"""The steps of OP in manual that would decide on a valve, bounded in OP and PV."""

from __future__ import annotations

import dataclasses
from typing import Any

from stiction_ros.identification.answer.experiment import CLEAR
from stiction_ros.identification.valve_test.frictions import LARGEST, SMALLEST
from stiction_ros.texts import spoken

WIDENS = 2.5
"""Times by which a pair is wider than the one before: six pairs go from the smallest friction of
interest to the largest."""
PAIRS = 2  # of a round
ROUNDS = 3


@dataclasses.dataclass(frozen=True)
class Facts:
    """What is known of a loop before its test.

    Attributes:
        valve: tag.
        op, pv: where the test begins, % and engineering units.
        gain: what 1 % of the stem makes of PV within a hold, engineering units, sign included; None
            where it is not known.
        noise: standard deviation of PV about its mean over a hold, same units.
        hold: s between two moves.
        op_limit: how far OP may go from ``op``, %.
        pv_limit: lowest and highest PV, engineering units.
    """

    valve: str
    op: float
    pv: float
    gain: float | None
    noise: float
    hold: float
    op_limit: float
    pv_limit: tuple[float, float]

    def widest(self) -> float:
        """Return how far OP may go from its start without PV passing its limit, %."""
        if not self.gain:
            return self.op_limit
        room = min(self.pv_limit[1] - self.pv, self.pv - self.pv_limit[0])
        return min(self.op_limit, max(room, 0.0) / abs(self.gain))


@dataclasses.dataclass(frozen=True)
class Plan:
    """One round of a test.

    Attributes:
        facts: of the loop.
        levels: OP after each move, %; the last is where it began.
    """

    facts: Facts
    levels: tuple[float, ...]

    @property
    def duration(self) -> float:
        """Seconds from the first move until the last has been held."""
        return self.facts.hold * len(self.levels)

    def to_json(self) -> dict[str, Any]:
        """Return the mapping of ``valve-test plan --json``."""
        facts = self.facts
        reach = max(abs(level - facts.op) for level in self.levels)
        moves = [{"after": i * facts.hold, "op": level} for i, level in enumerate(self.levels)]
        return {
            "valve": facts.valve,
            "start": {"op": facts.op, "pv": facts.pv},
            "moves": moves,
            "duration": self.duration,
            "pv_limit": list(facts.pv_limit),
            "return_op": facts.op,
            "expected": {
                "pv_move": None if facts.gain is None else abs(facts.gain) * reach,
                "decides_above": SMALLEST,
            },
            "sentence": self.sentence,
        }

    @property
    def sentence(self) -> str:
        """What is done, in one sentence."""
        low, high = self.facts.pv_limit
        levels = ", ".join(f"{level:.4g}" for level in self.levels)
        return (
            f"In manual, move OP of {self.facts.valve} to {levels} %, each held for "
            f"{spoken(self.facts.hold)}; return to {self.facts.op:.4g} % at once where PV leaves "
            f"{low:.4g} to {high:.4g}."
        )


def first_round(facts: Facts) -> Plan:
    """Return the first round: the smallest pairs whose answer PV's noise does not hide."""
    least = SMALLEST
    if facts.gain:
        least = max(least, 0.5 * CLEAR * facts.noise / abs(facts.gain))
    return _round(facts, least)


def further_round(facts: Facts, reach: float, responded: bool) -> Plan | None:
    """Return the next round.

    Args:
        facts: of the loop.
        reach: how far OP went from its start, %.
        responded: whether PV answered; the last pair is then repeated.

    Returns:
        None where the limits leave no other.
    """
    wanted = reach if responded else WIDENS * reach
    if not responded and reach >= 0.999 * min(facts.widest(), LARGEST):
        return None
    return _round(facts, wanted)


def _round(facts: Facts, least: float) -> Plan:
    most = min(facts.widest(), LARGEST)
    reaches = sorted({min(least * WIDENS**k, most) for k in range(PAIRS)})
    levels = [facts.op + sign * reach for reach in reaches for sign in (1.0, -1.0)]
    return Plan(facts, (*levels, facts.op))
