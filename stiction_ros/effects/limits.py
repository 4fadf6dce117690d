"""Ends that a signal cannot pass: of a valve's travel, and of a sensor's range."""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, FloatArray, Memory, Start
from stiction_ros.errors import InputError


@dataclasses.dataclass(frozen=True)
class Limits(Behaviour):
    """y = min(max(x, low), high), without memory."""

    def __post_init__(self) -> None:
        super().__post_init__()
        low, high = self._limits()
        if low > high:
            raise InputError(
                f"{low:g} is larger than high = {high:g}", where="low", fix="lower it or raise high"
            )

    def _limits(self) -> tuple[float, float]:
        low, high = (getattr(self, entry.attribute) for entry in self.parameters())
        return low, high

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        low, high = self._limits()
        return memory, min(max(value, low), high)

    @classmethod
    def simulate_grid(
        cls, grid: FloatArray, values: FloatArray, start: Start, sample_time: float = 1.0
    ) -> FloatArray:
        return np.minimum(np.maximum(values[:, None], grid[:, 0]), grid[:, 1])
