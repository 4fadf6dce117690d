"""A disturbance that wanders and never comes back by itself."""

import dataclasses
import math
from typing import ClassVar

from stiction_ros.effects.behaviour import NO_SAMPLE, DrivenByNoise, Memory, elapsed, parameter


@dataclasses.dataclass(frozen=True)
class RandomWalkDisturbance(DrivenByNoise):
    r"""Adds a random walk that starts at zero with the first sample.

    .. math:: w_k = w_{k-1} + \sigma \sqrt{T_s} \, n_k, \quad n_k \sim N(0, 1)
    """

    effect: ClassVar[str] = "random_walk"
    experiment: ClassVar[str] = "none: a wandering disturbance is what the noise model describes"
    not_searched: ClassVar[str] = (
        "a wandering disturbance is what the noise model describes; it is named where the noise is "
        "surely larger than the loop model declares"
    )

    rate: float = parameter("rate", "signal/√s", "standard deviation after one second", low=0.0)

    def step_with(
        self, memory: Memory, value: float, time: float, normal: float
    ) -> tuple[Memory, float]:
        assert isinstance(memory, tuple)
        last, before = memory
        spent = 0.0 if before == NO_SAMPLE else elapsed(before, time)
        wave = last + self.rate * math.sqrt(spent) * normal
        return (wave, time), value + wave
