"""A sensor, or a historian, that rounds."""

import dataclasses
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, Memory, parameter


@dataclasses.dataclass(frozen=True)
class Quantisation(Behaviour):
    """Rounds to the nearest multiple of ``step``, halves to even, without memory."""

    effect: ClassVar[str] = "quantisation"
    places: ClassVar[tuple[str, ...]] = ("sensor",)
    in_values: ClassVar[bool] = True
    not_searched: ClassVar[str] = "the values of PV show it, which are looked at first"

    quantum: float = parameter("step", "signal", "distance of two values", low=1e-12)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        return memory, self.quantum * float(np.rint(value / self.quantum))
