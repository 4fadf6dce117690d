"""What of a wanted OP may be written: within limits, and no faster than the rate."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray

SLACK = 1e-6  # %; limits are met to this


@dataclasses.dataclass(frozen=True)
class OpLimits:
    """Limits of the OPs of a loop.

    Attributes:
        low, high: %, shapes (m,).
        rate: % per second, shape (m,).
    """

    low: FloatArray
    high: FloatArray
    rate: FloatArray

    def within(self, op: FloatArray) -> bool:
        """Return whether each of ``op`` (m,), %, is a number between its limits."""
        return bool(((op >= self.low - SLACK) & (op <= self.high + SLACK)).all())

    def allowed(self, wanted: FloatArray, in_force: FloatArray, elapsed: float) -> FloatArray:
        """Return the OP nearest to ``wanted`` that may follow ``in_force`` after ``elapsed`` s.

        Without elapsed time it is the OP in force, so a transfer of control begins there.
        ``in_force`` must be :meth:`within` the limits; so is then the result. Shapes (m,), %.
        """
        reach = self.rate * max(elapsed, 0.0)
        near = np.clip(wanted, in_force - reach, in_force + reach)
        return np.clip(near, self.low, self.high)
