"""A coloured disturbance: noise with a memory."""

import dataclasses
import math
from typing import ClassVar

from stiction_ros.effects.behaviour import NO_SAMPLE, DrivenByNoise, Memory, elapsed, parameter


@dataclasses.dataclass(frozen=True)
class ColouredDisturbance(DrivenByNoise):
    r"""Adds first-order autoregressive noise of a given spread and time constant.

    .. math::
        w_k = \alpha w_{k-1} + \sigma \sqrt{1 - \alpha^2} \, n_k, \quad
        \alpha = e^{-T_s/\tau}, \; n_k \sim N(0, 1)

    The plant draws n from a random source of its own. The other noise does not depend on it.
    """

    effect: ClassVar[str] = "coloured"
    experiment: ClassVar[str] = "none: coloured noise is what the noise model describes"
    not_searched: ClassVar[str] = (
        "coloured noise is what the noise model describes; it is named where the noise is "
        "surely larger than the loop model declares"
    )

    std: float = parameter("std", "signal", "standard deviation σ", low=0.0)
    time_constant: float = parameter("tau", "s", "time constant τ", low=1e-9)

    def step_with(
        self, memory: Memory, value: float, time: float, normal: float
    ) -> tuple[Memory, float]:
        assert isinstance(memory, tuple)
        last, before = memory
        keep = 0.0 if before == NO_SAMPLE else math.exp(-elapsed(before, time) / self.time_constant)
        wave = keep * last + self.std * math.sqrt(1.0 - keep * keep) * normal
        return (wave, time), value + wave
