"""Slew: an actuator whose speed is limited."""

import dataclasses
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import (
    NO_SAMPLE,
    Behaviour,
    FloatArray,
    Memory,
    Start,
    elapsed,
    parameter,
    starts,
)
from stiction_ros.effects.seen import Seen


@dataclasses.dataclass(frozen=True)
class Slew(Behaviour):
    r"""The stem moves by no more than its rate allows.

    .. math::
        \chi_k = \chi_{k-1} + \min(\max(u_k - \chi_{k-1}, -r T_s), r T_s)

    The memory is (χ, time of the last sample). At the first sample no time has passed, so
    the stem is where it rested.
    """

    effect: ClassVar[str] = "slew"
    places: ClassVar[tuple[str, ...]] = ("valve",)
    experiment: ClassVar[str] = "move the set-point so far that OP moves fast"

    rate: float = parameter("rate", "%/s", "largest speed of the stem", low=0.0)

    @classmethod
    def reference(cls, seen: Seen) -> tuple[float, ...]:
        return (0.19 * seen.fastest,)

    def rest(self, value: float) -> Memory:
        return (value, NO_SAMPLE)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        assert isinstance(memory, tuple)
        stem, before = memory
        reach = self.rate * elapsed(before, time)
        stem = min(max(value, stem - reach), stem + reach)
        return (stem, time), stem

    @classmethod
    def simulate_grid(
        cls, grid: FloatArray, values: FloatArray, start: Start, sample_time: float = 1.0
    ) -> FloatArray:
        from stiction_ros.effects.grid_kernels import slewing  # compiled: slow to import

        reach = grid[:, 0] * sample_time
        return slewing(reach, np.asarray(values, dtype=float), starts(start, len(reach)))
