"""A sensor, or a historian, that rounds."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, FloatArray, Memory, parameter


@dataclasses.dataclass(frozen=True)
class Quantisation(Behaviour):
    """Rounds to the nearest multiple of ``step``, halves to even, without memory.

    Raises:
        InputError: a quantum that is not positive.
    """

    effect: ClassVar[str] = "quantisation"
    places: ClassVar[tuple[str, ...]] = ("sensor",)
    signature: ClassVar[str] = "PV takes few values, all multiples of one quantum"
    minimum_data: ClassVar[str] = "PV crosses several quanta"
    confusable: ClassVar[tuple[str, ...]] = ("sensor freeze",)
    in_values: ClassVar[bool] = True
    not_searched: ClassVar[str] = "the values of PV show it, which are looked at first"

    quantum: float = parameter("step", "signal", "distance of two values", low=1e-12)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        return memory, self.quantum * float(np.rint(value / self.quantum))

    @classmethod
    def simulate_grid(
        cls,
        grid: FloatArray,
        values: FloatArray,
        start: FloatArray | float,
        sample_time: float = 1.0,
    ) -> FloatArray:
        """Return outputs, shape (N, G), for rows (step,)."""
        quantum = grid[:, 0]
        return np.asarray(quantum * np.rint(values[:, None] / quantum))
