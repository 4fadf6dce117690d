"""Whether a value is one that its instrument can have measured."""

from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import Instrument

BELIEVED = 10  # values in succession that are too far away but agree with one another
CONFIRMED = 3  # the same of values that may be, after a gap, but are not where PV was seen last


class SignalCheck:
    """Holds measurements and set-points against ranges and rate limits.

    A measurement moves no faster than ``rate_limit`` times the time since the last good one.
    After a gap that is a wide limit, and an instrument that comes back may show anything first:
    a value that would be too fast for one sample is believed when it is the third in succession
    that agree with one another. After :data:`BELIEVED` values in succession that are too fast for
    the last good one, but not for one another, the last good one is taken to be the wrong one.
    """

    def __init__(self, instruments: Sequence[Instrument]) -> None:
        """Start without a past; one instrument per output (p)."""
        self._low = np.array([one.low for one in instruments])
        self._high = np.array([one.high for one in instruments])
        self._rate = np.array([one.rate_limit for one in instruments])
        self.forget()

    def forget(self) -> None:
        """Forget all measurements, as at the begin of a run."""
        p = len(self._low)
        self._good: FloatArray = np.full(p, np.nan)
        self._good_at: FloatArray = np.zeros(p)
        self._odd: FloatArray = np.full(p, np.nan)
        self._odd_at = 0.0
        self._odds = np.zeros(p, dtype=int)

    def within(self, values: FloatArray) -> bool:
        """Return whether all ``values`` (p,) or rows of them are finite and within their range."""
        return bool(np.all((values >= self._low) & (values <= self._high) & np.isfinite(values)))

    def measured(self, time: float, pv: FloatArray) -> FloatArray:
        """Return ``pv`` (p,) with NaN for what is not credible at ``time`` in s, which rises."""
        inside = (pv >= self._low) & (pv <= self._high) & np.isfinite(pv)
        values = np.where(inside, pv, np.nan)
        moved, step = values - self._good, time - self._odd_at
        near = self._slow(moved, step) | np.isnan(self._good)
        possible = self._slow(moved, time - self._good_at)
        agrees = self._slow(values - self._odd, step)
        self._odds = np.where(inside & ~near, np.where(agrees, self._odds + 1, 1), 0)
        self._odd, self._odd_at = values, time
        wanted = np.where(possible, CONFIRMED, BELIEVED)
        credible = inside & (near | (self._odds >= wanted))
        self._good = np.where(credible, values, self._good)
        self._good_at = np.where(credible, time, self._good_at)
        return np.where(credible, values, np.nan)

    def _slow(self, moved: FloatArray, seconds: FloatArray | float) -> FloatArray:
        with np.errstate(invalid="ignore"):
            return np.asarray(np.abs(moved) <= self._rate * seconds)
