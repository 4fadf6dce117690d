"""An unmeasured disturbance that is a sine."""

import dataclasses
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.effects.disturbance.periodic import PeriodicDisturbance


@dataclasses.dataclass(frozen=True)
class SineDisturbance(PeriodicDisturbance):
    """Adds a sine, by default one that starts at zero with the first sample."""

    effect: ClassVar[str] = "sine"

    @staticmethod
    def wave(angle: FloatArray) -> FloatArray:
        return np.asarray(np.sin(angle))
