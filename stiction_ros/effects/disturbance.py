"""Unmeasured disturbances that add to a signal: a step, a drift, a sine."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar

from stiction_ros.effects.behaviour import Behaviour, Memory, parameter


@dataclasses.dataclass(frozen=True)
class StepDisturbance(Behaviour):
    """Adds ``size`` from ``time`` on."""

    effect: ClassVar[str] = "step"
    places: ClassVar[tuple[str, ...]] = ("disturbance",)
    signature: ClassVar[str] = "a gap that is another constant before and after one moment"
    minimum_data: ClassVar[str] = "samples on both sides, longer than the noise remembers"
    confusable: ClassVar[tuple[str, ...]] = ("sensor bias_step", "disturbance drift")

    onset: float = parameter("time", "s", "time of the step since the first sample")
    size: float = parameter("size", "signal", "height of the step")

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        return memory, value + (self.size if time >= self.onset else 0.0)


@dataclasses.dataclass(frozen=True)
class DriftDisturbance(Behaviour):
    """Adds a ramp that starts with the first sample."""

    effect: ClassVar[str] = "drift"
    places: ClassVar[tuple[str, ...]] = ("disturbance", "sensor")
    signature: ClassVar[str] = "a gap that grows in proportion to time"
    minimum_data: ClassVar[str] = "a record much longer than the noise remembers"
    confusable: ClassVar[tuple[str, ...]] = ("disturbance drift", "sensor drift", "process leak")

    rate: float = parameter("rate", "signal/s", "slope of the ramp")

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        return memory, value + self.rate * time


@dataclasses.dataclass(frozen=True)
class SineDisturbance(Behaviour):
    """Adds a sine, by default one that starts at zero with the first sample."""

    effect: ClassVar[str] = "sine"
    places: ClassVar[tuple[str, ...]] = ("disturbance",)
    signature: ClassVar[str] = "a gap with one spectral line, whose phase OP does not move"
    minimum_data: ClassVar[str] = "four periods"
    confusable: ClassVar[tuple[str, ...]] = ("disturbance coloured",)

    amplitude: float = parameter("amplitude", "signal", "half the peak-to-peak height", low=0.0)
    period: float = parameter("period", "s", "length of one cycle", low=1e-9)
    phase: float = parameter("phase", "rad", "phase at the first sample", default=0.0)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        angle = 2.0 * math.pi * time / self.period + self.phase
        return memory, value + self.amplitude * math.sin(angle)
