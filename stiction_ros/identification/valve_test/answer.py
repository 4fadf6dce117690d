"""The answer to the record of a test: the verdict, or the next moves."""

import dataclasses
from typing import Any

from stiction_ros.identification.valve_test.facts import Limits, facts_of_test, judged_record
from stiction_ros.identification.valve_test.judgement import Judgement
from stiction_ros.identification.valve_test.plan import Facts, Plan, further_round
from stiction_ros.records.record import Record


@dataclasses.dataclass(frozen=True)
class Answer:
    """A verdict with the next round."""

    judgement: Judgement  # of the test so far
    plan: Plan | None  # the next round; None where it is decided or the limits leave none

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``valve-test judge --json``."""
        plan = None if self.plan is None else self.plan.to_dict()
        return {**self.judgement.to_dict(), "next": plan, "sentence": self.judgement.sentence}


def answer(record: Record, facts: Facts | None, limits: Limits) -> Answer:
    """Return the verdict on a record of a test, and what is next.

    Args:
        record: of one valve and one output.
        facts: what was known before; None for nothing.
        limits: of the next round, where nothing was known before.

    Raises:
        InputError: several valves or outputs, or OP does not move as by hand.
    """
    judgement = judged_record(record, None if facts is None else facts.gain)
    plan = None
    if not judgement.decided:
        if facts is None:
            facts = facts_of_test(record, judgement, limits)
        began = float(judgement.trial.steps.levels[0])
        plan = further_round(dataclasses.replace(facts, op=began), judgement)
    return Answer(judgement, plan)
