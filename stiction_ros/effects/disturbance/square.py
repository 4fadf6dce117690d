"""An unmeasured disturbance that is a square wave."""

import dataclasses
import math
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.effects.disturbance.periodic import PeriodicDisturbance


@dataclasses.dataclass(frozen=True)
class SquareDisturbance(PeriodicDisturbance):
    """Adds a square wave: up for half a period, then down for as long."""

    effect: ClassVar[str] = "square"

    @staticmethod
    def wave(angle: FloatArray) -> FloatArray:
        turn = angle / (2.0 * math.pi)
        turn -= np.floor(turn)
        return np.where(turn < 0.5, 1.0, -1.0)

    @classmethod
    def held(cls, angle: FloatArray, turned: float | FloatArray) -> FloatArray:
        """Return the mean from each angle on: where it changes sides between, part of both."""
        begins, ends = angle / (2.0 * math.pi), (angle + turned) / (2.0 * math.pi)
        return np.asarray((_area(ends) - _area(begins)) / (ends - begins))


def _area(turn: FloatArray) -> FloatArray:
    """Return the integral of the wave of height one from the begin of its turn."""
    return np.asarray(0.5 - np.abs(turn - np.floor(turn) - 0.5))
