"""An unmeasured disturbance that is a triangle wave."""

import dataclasses
import math
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.effects.disturbance.periodic import PeriodicDisturbance


@dataclasses.dataclass(frozen=True)
class TriangleDisturbance(PeriodicDisturbance):
    """Adds a triangle wave that, as a sine, starts at zero and upwards."""

    effect: ClassVar[str] = "triangle"

    @staticmethod
    def wave(angle: FloatArray) -> FloatArray:
        turn = angle / (2.0 * math.pi) + 0.25
        turn -= np.floor(turn)
        return np.asarray(1.0 - 4.0 * np.abs(turn - 0.5))
