"""A gate before the observer: one wild measurement is no news, a lasting one is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray

FORGETTING = 0.98  # of the running mean square of what was passed on


class InnovationGate:
    """Holds back innovations that are far too large, until they last.

    The gate of an output stands at ``width`` times its expected standard deviation, or that
    of the innovations passed on lately where it is larger, so that a noise that was given
    too small does not close it. After ``patience`` successive samples beyond it the change
    is real and is passed on, until an innovation fits again.
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
        # Only what fits widens the gate, or a lasting fault would open it for good.
        calm = np.where(wild, self._usual, size)
        self._usual = np.hypot(np.sqrt(FORGETTING) * self._usual, np.sqrt(1 - FORGETTING) * calm)
        return np.where(self.closed, 0.0, innovation)
