"""Backlash: the play between actuator and stem."""

import dataclasses
from collections.abc import Sequence
from typing import ClassVar

from stiction_ros.effects.behaviour import Behaviour, FloatArray, Memory, parameter
from stiction_ros.effects.friction.stiction import Stiction
from stiction_ros.effects.seen import Seen


@dataclasses.dataclass(frozen=True)
class Backlash(Behaviour):
    r"""The stem follows OP only after OP has crossed the play.

    .. math::
        \chi_k = \min(\max(\chi_{k-1}, u_k - \tfrac{b}{2}), u_k + \tfrac{b}{2})

    The memory is the stem position χ, which rests in the middle of the play. It is He's law
    (3) with f_S = f_D = b/2, that is stiction without a jump.
    """

    effect: ClassVar[str] = "backlash"
    places: ClassVar[tuple[str, ...]] = ("valve",)
    experiment: ClassVar[str] = "let OP reverse by more than the play that matters"
    separation: ClassVar[str] = Stiction.separation
    family: ClassVar[str] = "friction"
    least: ClassVar[float] = 0.1  # %
    kernel: ClassVar[str] = "playing"

    band: float = parameter("band", "%", "travel of OP that is lost at a reversal", low=0.0)

    @classmethod
    def reference(cls, seen: Seen) -> tuple[float, ...]:
        return (1.0,)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        assert isinstance(memory, float | int)
        half = self.band / 2.0
        stem = min(max(float(memory), value - half), value + half)
        return stem, stem

    @classmethod
    def kernel_figures(cls, grid: FloatArray, sample_time: float) -> Sequence[FloatArray]:
        return [grid[:, 0] / 2.0]
