"""Slew: an actuator whose speed is limited."""

import dataclasses
from collections.abc import Sequence
from typing import ClassVar

from stiction_ros.effects.behaviour import (
    NO_SAMPLE,
    Behaviour,
    FloatArray,
    Memory,
    elapsed,
    parameter,
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
    kernel: ClassVar[str] = "slewing"

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
    def kernel_figures(cls, grid: FloatArray, sample_time: float) -> Sequence[FloatArray]:
        return [grid[:, 0] * sample_time]
