"""What the disturbances share that come again and again."""

import dataclasses
import math
from abc import abstractmethod
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, FloatArray, Memory, parameter


@dataclasses.dataclass(frozen=True)
class PeriodicDisturbance(Behaviour):
    """What the periodic waves share: they add ``amplitude`` times a wave of height one."""

    places: ClassVar[tuple[str, ...]] = ("load", "disturbance")
    experiment: ClassVar[str] = "take a record of many periods"

    amplitude: float = parameter("amplitude", "signal", "half the peak-to-peak height", low=0.0)
    period: float = parameter("period", "s", "length of one cycle", low=1e-9)
    phase: float = parameter("phase", "rad", "phase at the first sample", default=0.0)

    @staticmethod
    @abstractmethod
    def wave(angle: FloatArray) -> FloatArray:
        """Return the wave of height one at angles in rad, same shape."""

    @classmethod
    def held(cls, angle: FloatArray, turned: float | FloatArray) -> FloatArray:
        """Return the mean of the wave of height one from each angle on, over so many rad."""
        return cls.wave(angle + 0.5 * turned)

    def entering(self, time: FloatArray, sample_time: float) -> FloatArray:
        """Return the means over the samples that begin at some times: what a process takes up."""
        angle = np.asarray(2.0 * math.pi * time / self.period + self.phase)
        return self.amplitude * self.held(angle, 2.0 * math.pi * sample_time / self.period)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        angle = np.array(2.0 * math.pi * time / self.period + self.phase)
        return memory, value + self.amplitude * float(self.wave(angle))

    def simulate(
        self, values: FloatArray, start: float | None = None, sample_time: float = 1.0
    ) -> FloatArray:
        time = np.arange(len(values)) * sample_time
        angle = np.asarray(2.0 * math.pi * time / self.period + self.phase)
        return np.asarray(values + self.amplitude * self.wave(angle))
