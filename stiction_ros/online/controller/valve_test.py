"""A valve test in a running loop, a sample at a time."""

from __future__ import annotations

from concurrent.futures import Future

import numpy as np

from stiction_ros.identification.valve_test.judgement import Judgement, judged
from stiction_ros.identification.valve_test.plan import (
    ROUNDS,
    STOPS,
    Facts,
    Plan,
    first_round,
    further_round,
)
from stiction_ros.online.handover.background import Background


class ValveTest:
    """The moves of one test, decided as they are answered.

    OP rests for a hold, makes the moves of the plan, and is judged after each; the test ends when
    it is decided, when three rounds or the limits leave no other move, or when something happens
    that it does not allow for. OP then goes back to where it was, unless someone else has it.

    Attributes:
        over: why it ended; empty while it runs.
        judgement: the last one; None before the second move has been held.
    """

    def __init__(self, facts: Facts, hold: int, background: Background) -> None:
        """Begin with OP where it is.

        Args:
            facts: of the loop.
            hold: samples for which each level is held.
            background: where the judgements are made.
        """
        self.facts, self.hold, self._background = facts, hold, background
        self.over = ""
        self.judgement: Judgement | None = None
        self._plan: Plan | None = first_round(facts)
        self._level, self._moves, self._made, self._rounds = facts.op, 0, 0, 1
        self._left = hold
        self._op: list[float] = []
        self._pv: list[float] = []
        self._work: Future[Judgement] | None = None

    def stop(self, reason: str) -> None:
        """End the test."""
        self.over = self.over or reason

    def next_op(self, pv: float) -> float:
        """Return OP, %, for the present sample.

        Args:
            pv: engineering units; NaN ends the test.
        """
        low, high = self.facts.pv_limit
        if not np.isfinite(pv):
            self.stop("PV is bad")
        elif not low <= pv <= high:
            self.stop(f"PV {pv:.4g} is outside {low:.4g} to {high:.4g}")
        if not self.over and self._left <= 0:
            self._go_on()
        if self.over:
            return self.facts.op
        self._op.append(self._level)
        self._pv.append(pv)
        self._left -= 1
        return self._level

    def _go_on(self) -> None:
        """Judge what was answered, and move on where the judgement is there and leaves it open."""
        if self._moves > 1:
            if self._work is None:
                op, pv = np.array(self._op), np.array(self._pv)
                self._work = self._background.submit(judged, op, pv)
            if not self._work.done():
                return
            self.judgement, self._work = self._work.result(), None
            told = self.judgement.probability
            if self.judgement.decided and not 1.0 - STOPS < told < STOPS:
                self.stop(self.judgement.sentence)
                return
        if self._plan is not None and self._made == len(self._plan.levels):
            assert self.judgement is not None
            self._plan = further_round(self.facts, self.judgement)
            self._rounds, self._made = self._rounds + 1, 0
        if self._plan is None or self._rounds > ROUNDS:
            assert self.judgement is not None
            self.stop(self.judgement.sentence)
            return
        self._level = self._plan.levels[self._made]
        self._made, self._moves, self._left = self._made + 1, self._moves + 1, self.hold
