"""From where the loop is to its set-point, without a kick."""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray


class Approach:
    """A set-point that begins at PV and is at its own value some samples later.

    After a start, and after a hold, PV may be far from the set-point; a controller that answers
    the whole error at once moves the valves further than any move of the set-point does.
    """

    def __init__(self, pv: FloatArray, sp: FloatArray, samples: int) -> None:
        """Begin at ``pv`` (p,), to be at the set-points after ``samples``, ``sp`` (p,) now."""
        self._from, self._samples = pv - sp, samples
        self._sample = 0

    @property
    def over(self) -> bool:
        """Whether the next aim is the set-point itself."""
        return self._sample >= self._samples

    def aim(self, sp: FloatArray) -> FloatArray:
        """Return what to aim at in the next sample, shape (p,), with set-points ``sp`` (p,)."""
        self._sample += 1
        left = max(1.0 - self._sample / (self._samples + 1), 0.0)
        return np.asarray(sp + left * self._from)
