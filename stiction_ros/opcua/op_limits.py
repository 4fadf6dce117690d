"""What of a wanted OP may be written, within limits and rate, and what the rate has cut of it."""

import dataclasses
from collections import deque
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray

SLACK = 1e-6  # %; limits are met to this
WATCHED = 60  # OPs that are looked back at


@dataclasses.dataclass(frozen=True)
class OpLimits:
    """Limits of the OPs of a loop."""

    low: FloatArray  # low, high: %, shapes (m,)
    high: FloatArray
    rate: FloatArray  # % per second, shape (m,)

    def within(self, op: FloatArray) -> bool:
        """Return whether each of ``op`` (m,), %, is a number between its limits."""
        return bool(((op >= self.low - SLACK) & (op <= self.high + SLACK)).all())

    def crossed(self, valves: Sequence[str]) -> str:
        """Return in words which of the m ``valves`` has limits that no OP meets; empty for none."""
        return "; ".join(
            f"limits of {name} are {low:g} to {high:g}"
            for name, low, high in zip(valves, self.low, self.high, strict=True)
            if low > high
        )

    def allowed(self, wanted: FloatArray, in_force: FloatArray, elapsed: float) -> FloatArray:
        """Return the OP nearest to ``wanted`` that may follow ``in_force`` after ``elapsed`` s.

        Without elapsed time it is the OP in force, so a transfer of control begins there.
        ``in_force`` must be :meth:`within` the limits; so is then the result. Shapes (m,), %.
        """
        reach = self.rate * max(elapsed, 0.0)
        near = np.clip(wanted, in_force - reach, in_force + reach)
        return np.clip(near, self.low, self.high)


class RateWatch:
    """Which of the last 60 OPs the rate has cut, and how large the wanted steps were.

    The way from the OP in force at a transfer to what the controller wants then is no jump, so
    the samples that it takes are left out.
    """

    def __init__(self, valves: Sequence[str], rates: Sequence[float], sample_time: float) -> None:
        """Take names and rates, % per second of the plant's time, of m valves, and a sample, s."""
        self._valves, self._rates = tuple(valves), tuple(rates)
        self._reach = np.array(rates) * sample_time
        self._on_the_way = 0  # samples that the way from a transfer may still take
        self._steps: deque[FloatArray] = deque(maxlen=WATCHED)

    def begin(self, limits: OpLimits, wanted: FloatArray, in_force: FloatArray) -> None:
        """Begin anew with a new grant, where ``wanted`` (m,), % meets ``in_force`` (m,), %."""
        self._steps.clear()
        way = np.abs(np.clip(wanted, limits.low, limits.high) - in_force)
        # One more, as a sample that comes a little early reaches a little less.
        self._on_the_way = int(np.ceil(way / self._reach).max()) + 1

    def note(
        self, limits: OpLimits, wanted: FloatArray, in_force: FloatArray, op: FloatArray
    ) -> bool:
        """Note an ``op`` that follows ``in_force``; return whether the rate has cut the wanted one.

        What the other ``limits`` cut is not the rate's. Shapes (m,), %.
        """
        reachable = np.clip(wanted, limits.low, limits.high)
        cut = np.abs(reachable - op) > SLACK
        self._on_the_way = self._on_the_way - 1 if cut.any() else 0
        if self._on_the_way > 0:
            return True
        self._on_the_way = 0
        self._steps.append(np.where(cut, np.abs(reachable - in_force), 0.0))
        return bool(cut.any())

    def keys(self) -> list[tuple[str, object]]:
        """Return how many of the last OPs were cut of each valve, of how many, and the steps."""
        found: list[tuple[str, object]] = [("rate_watched", len(self._steps))]
        for name, _, count, step in self._cut():
            found += [(f"rate_cut:{name}", count), (f"wanted_step:{name}", f"{step:.3g}")]
        return found

    def text(self) -> str:
        """Return in words what was cut; empty for nothing."""
        return "; ".join(
            f"OP of {name} is cut by the map's rate of {rate:g} %/s at {count} of the last "
            f"{len(self._steps)} samples; the controller wanted steps up to {step:.1f} %"
            for name, rate, count, step in self._cut()
            if count
        )

    def _cut(self) -> list[tuple[str, float, int, float]]:
        """Return name, rate, count and largest step of each valve."""
        steps = np.array(self._steps).reshape(-1, len(self._valves))
        counts, largest = (steps > 0.0).sum(axis=0), steps.max(axis=0, initial=0.0)
        return [
            (name, rate, int(count), float(step))
            for name, rate, count, step in zip(
                self._valves, self._rates, counts, largest, strict=True
            )
        ]
