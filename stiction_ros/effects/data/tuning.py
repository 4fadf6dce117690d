"""A controller that is tuned otherwise than it was written down."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import NO_SAMPLE, Behaviour, Memory, elapsed, parameter


@dataclasses.dataclass(frozen=True)
class Tuning(Behaviour):
    r"""The PI controller that was at work: from the control error to the change of OP.

    .. math::
        u_k = u_{k-1} + K \left[ (e_k - e_{k-1}) + \tfrac{T_s}{T_i} e_k \right]

    The signal is e = SP − PV, what comes out is OP less the OP before the first sample. The
    memory is (u, e, time of the last sample). At the first sample OP does not move.
    """

    effect: ClassVar[str] = "tuning"
    places: ClassVar[tuple[str, ...]] = ("data",)
    experiment: ClassVar[str] = "record SP, and the tuning as it is written down"
    not_searched: ClassVar[str] = (
        "OP recomputed from PV and SP shows it, where both and a tuning are recorded"
    )

    gain: float = parameter("gain", "%/signal", "signed gain K")
    integral_time: float = parameter("integral_time", "s", "integral time T_i", low=1e-9)

    def rest(self, value: float) -> Memory:
        return (0.0, value, NO_SAMPLE)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        assert isinstance(memory, tuple)
        op, last, before = memory
        if before == NO_SAMPLE:
            return (op, value, time), op
        share = elapsed(before, time) / self.integral_time
        op += self.gain * (value - last + share * value)
        return (op, value, time), op
