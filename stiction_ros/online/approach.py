"""From where the loop is to its set-point, without a kick."""

from __future__ import annotations

import numpy as np

from stiction_ros.effects.behaviour import FloatArray


class Approach:
    """A set-point that begins at PV and is at its own value some samples later.

    After a start, and after a hold, PV may be far from the set-point; a controller that answers
    the whole error at once moves the valves further than any move of the set-point does.
    """

    def __init__(self) -> None:
        """Begin with the next measurement."""
        self._from: FloatArray | None = None
        self._sample = 0

    def aim(self, pv: FloatArray, sp: FloatArray, samples: int) -> FloatArray:
        """Return what to aim at now, shape (p,): ``sp`` itself when the approach is over.

        Args:
            pv: measurement, shape (p,); what is not finite begins nothing.
            sp: set-points, shape (p,).
            samples: length of the approach.
        """
        if self._from is None:
            if not np.isfinite(pv).all():
                return sp
            self._from = pv - sp
        self._sample += 1
        if self._sample > samples:
            return sp
        return np.asarray(sp + (1.0 - self._sample / (samples + 1)) * self._from)
