"""A valve that stops short of its ends."""

import dataclasses
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, FloatArray, Memory, Start, parameter
from stiction_ros.errors import InputError


@dataclasses.dataclass(frozen=True)
class Saturation(Behaviour):
    """A stem that stops at ``low`` and ``high``, inside of what OP asks, without memory."""

    effect: ClassVar[str] = "saturation"
    places: ClassVar[tuple[str, ...]] = ("valve",)
    experiment: ClassVar[str] = "drive OP towards the limit and hold it there until PV settles"
    bends: ClassVar[bool] = True

    low: float = parameter("low", "%", "lowest position of the stem")
    high: float = parameter("high", "%", "highest position of the stem")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low > self.high:
            raise InputError(
                f"{self.low:g} is larger than high = {self.high:g}",
                where="low",
                fix="lower it or raise high",
            )

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        return memory, min(max(value, self.low), self.high)

    @classmethod
    def simulate_grid(
        cls, grid: FloatArray, values: FloatArray, start: Start, sample_time: float = 1.0
    ) -> FloatArray:
        return np.minimum(np.maximum(values[:, None], grid[:, 0]), grid[:, 1])
