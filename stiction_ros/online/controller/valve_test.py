"""A valve test in a running loop, a sample at a time."""

import math
from concurrent.futures import Executor, Future

import numpy as np

from stiction_ros.identification.valve_test.judgement import Judgement, judged, measured_enough
from stiction_ros.identification.valve_test.plan import (
    CLEAR,
    Facts,
    first_round,
    further_round,
    stays,
)

MOST = 30
"""Moves of a test: three rounds of five pairs, as many as go from the smallest friction of interest
to the largest."""
RESTS = 5  # holds that are waited for at most until PV rests


class ValveTest:
    """The moves of one test, decided as they are answered.

    OP rests until PV does, makes the moves of the plan, and is judged after each; each further pair
    is chosen by what was answered so far. The test ends when it is decided, friction also known to
    ``margin``, when :data:`MOST` moves or the limits leave no other, or when something happens that
    it does not allow for. OP then goes back to where it was, unless someone else has it.

    Attributes:
        moves: of OP that were made.
        over: why it ended; empty while it runs.
        judgement: the last one; None before the second move has been held.
    """

    def __init__(
        self, facts: Facts, hold: int, background: Executor, margin: float = math.inf
    ) -> None:
        """Begin with OP where it is.

        Args:
            facts: of the loop.
            hold: samples for which each level is held.
            background: where the judgements are made.
            margin: of f_S, to which friction is sized.
        """
        self.facts, self.hold, self._background, self._margin = facts, hold, background, margin
        self.over = ""
        self.judgement: Judgement | None = None
        self._level, *self._levels = (facts.op, *first_round(facts).levels[:-1])
        self.moves, self._left = 0, hold
        self._met = ""  # limit of PV that was met: OP is back, and what PV showed is judged
        self._late = max(math.ceil(facts.dead / facts.hold * hold), 1) + 1
        self._op: list[float] = []
        self._pv: list[float] = []
        self._work: Future[Judgement] | None = None

    def stop(self, reason: str) -> None:
        self.over = self.over or reason

    def next_op(self, pv: float) -> float:
        """Return OP, %, for the present sample.

        Args:
            pv: engineering units; NaN ends the test.
        """
        low, high = self.facts.pv_limit
        if not np.isfinite(pv):
            self.stop("PV is bad")
        elif not self._met and not (low <= pv <= high and low <= self._coming(pv) <= high):
            self._met = f"PV {pv:.4g} goes beyond {low:.4g} to {high:.4g}"
            self._pv.append(pv)
            self._op.append(self._level)
        if not self.over and self._met:
            if self._judged():
                self.stop(f"{self._met}. {self._told}".strip())
        elif not self.over and self._left <= 0:
            self._go_on()
        if self.over or self._met:
            return self.facts.op
        self._op.append(self._level)
        self._pv.append(pv)
        self._left -= 1
        return self._level

    def _coming(self, pv: float) -> float:
        """Return PV a dead time from now, before which no move of OP can show, by its trend."""
        late = self._late
        recent = [*self._pv[1 - 2 * late :], pv]
        if len(recent) < 2 * late:
            return pv
        now = float(np.mean(recent[late:]))
        return now + 1.5 * (now - float(np.mean(recent[:late])))

    def _rests(self) -> bool:
        """Return whether PV is the same in both halves of the last hold, but for noise."""
        half = self.hold // 2
        one, other = np.mean(self._pv[-2 * half : -half]), np.mean(self._pv[-half:])
        return abs(float(other - one)) <= CLEAR * self.facts.noise

    def _judged(self) -> bool:
        """Judge what was answered, where that is enough; return whether nothing is waited for."""
        if self._work is None:
            if self.moves < 2 or not measured_enough(np.array(self._pv), self.moves):
                return True
            signals = np.array(self._op), np.array(self._pv)
            self._work = self._background.submit(judged, *signals, self.facts.gain)
        if not self._work.done():
            return False
        self.judgement, self._work = self._work.result(), None
        return True

    @property
    def _told(self) -> str:
        return "" if self.judgement is None else self.judgement.sentence

    def _go_on(self) -> None:
        """Move on where what was answered is judged and leaves it open."""
        if not self._judged():
            return
        if self.judgement is not None:
            if self.judgement.sure and self.judgement.known_to <= self._margin:
                self.stop(self._told)
                return
            if self.moves % 2 == 0 and not (
                self._levels and stays(self.facts, self.judgement, self._levels[:2])
            ):
                plan = None
                if self.moves < MOST:
                    plan = further_round(self.facts, self.judgement, 1)
                self._levels = [] if plan is None else list(plan.levels[:-1])
        if not self._levels:
            self.stop(self._told or "PV shows hardly any value that is measured")
            return
        if not self.moves:
            if len(self._op) < RESTS * self.hold and not self._rests():
                self._left = self.hold
                return
            del self._op[: -self.hold], self._pv[: -self.hold]
        self._level, *self._levels = self._levels
        self.moves, self._left = self.moves + 1, self.hold
