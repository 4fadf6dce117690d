"""A gate before the observer: one wild measurement is no news, a lasting one is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray

FORGETTING = 0.98  # of the running mean square of what was passed on
LIVELY = 2.0  # innovations beyond this many times the usual one count as no more than that


class InnovationGate:
    """Holds back innovations that are far too large, until they last.

    The gate of an output stands at ``width`` times its expected standard deviation, or that
    of the innovations passed on lately where it is larger, so that a noise that was given
    too small does not close it. It widens by 3 % a sample at most, so that bad values do not
    open it for others. After ``patience`` successive samples beyond it the change is real and
    is passed on in growing portions, one gate width more at each sample, until an innovation
    fits again: a step of a few units passes at once, a value out of all proportion does not.
    """

    def __init__(self, deviation: FloatArray, width: float, patience: int) -> None:
        """Start open; ``deviation`` (p,) in the units of PV, all positive."""
        self._floor = self._usual = deviation
        self._width, self._patience = width, patience
        self._beyond = np.zeros(len(deviation), dtype=int)
        self.closed: NDArray[np.bool_] = np.zeros(len(deviation), dtype=bool)

    def pass_on(self, innovation: FloatArray) -> FloatArray:
        """Return ``innovation`` (p,) with 0 for every output that is held back."""
        size = np.abs(innovation)
        wild = size > self._width * np.maximum(self._floor, self._usual)
        self._beyond = np.where(wild, self._beyond + 1, 0)
        self.closed = wild & (self._beyond <= self._patience)
        # Only what fits widens the gate, and slowly, or a lasting fault would open it for good.
        usual = np.maximum(self._floor, self._usual)
        calm = np.where(wild, self._usual, np.minimum(size, LIVELY * usual))
        self._usual = np.hypot(np.sqrt(FORGETTING) * self._usual, np.sqrt(1 - FORGETTING) * calm)
        portion = np.where(wild, (self._beyond - self._patience) * self._width * usual, np.inf)
        return np.where(self.closed, 0.0, np.clip(innovation, -portion, portion))
