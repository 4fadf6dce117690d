"""Whether the disturbance estimate is on its way, so that a jump had better wait for its end."""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray

SHARE = 0.2  # of each new innovation in the mean
DEVIATION = float(np.sqrt(SHARE / (2.0 - SHARE)))  # of the mean of white innovations
LEAN = 1.2  # of these
REST = 10  # samples after a jump, which may belong to a pair, and no pair is longer
FREE = 5  # samples after a set-point move
INNOVATION = 4.0  # standard deviations that one innovation counts for at most


class Passage:
    """A mean of the latest innovations that leans to one side.

    A plan takes the disturbance estimate for constant. While innovations lean it is not: it is on
    its way to where the disturbance will be, and a stem that jumps after it now jumps again soon.
    A stem at rest then waits, ``longest`` samples at most.
    """

    def __init__(self, longest: int) -> None:
        """Begin with a mean of 0; ``longest`` 0 never waits."""
        self.longest = longest
        self._mean: FloatArray | None = None
        self._stem: FloatArray | None = None
        self._sp: FloatArray | None = None
        self._still = self._held = self._waited = 0

    def take_in(self, innovation: FloatArray) -> None:
        """Take in ``innovation``, shape (p,), in its standard deviations."""
        if not self.longest:
            return
        bounded = np.clip(innovation, -INNOVATION, INNOVATION)
        before = np.zeros_like(bounded) if self._mean is None else self._mean
        self._mean = (1.0 - SHARE) * before + SHARE * bounded

    def waits(self, stem: FloatArray, sp: FloatArray) -> bool:
        """Return whether a jump should wait now, by stems, (s,), %, and set-points, (p,)."""
        if not self.longest or not len(stem):
            return False
        rests = self._stem is not None and bool(np.abs(stem - self._stem).max() <= 1e-6)
        holds = self._sp is not None and np.array_equal(sp, self._sp)
        self._still = self._still + 1 if rests else 0
        self._held = self._held + 1 if holds else 0
        self._stem, self._sp = stem.copy(), sp.copy()
        leans = self._mean is not None and bool(np.abs(self._mean).max() > LEAN * DEVIATION)
        if not leans or self._still < REST:
            self._waited = 0
        elif self._waited < self.longest and self._held >= FREE:
            self._waited += 1
            return True
        return False
