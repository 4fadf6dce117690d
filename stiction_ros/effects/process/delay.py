"""A process that answers later than its model."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import parameter
from stiction_ros.effects.delays import LONGEST, Delay
from stiction_ros.effects.seen import Seen


@dataclasses.dataclass(frozen=True)
class ExtraDelay(Delay):
    r"""A longer dead time: y_k = (1 − f) x_{k−n} + f x_{k−n−1} for n + f more samples."""

    effect: ClassVar[str] = "delay"
    places: ClassVar[tuple[str, ...]] = ("process",)
    experiment: ClassVar[str] = "move the set-point in steps"
    separation: ClassVar[str] = (
        "record the set-point and the controller's tuning, or put OP and PV on one clock"
    )
    absorbed: ClassVar[bool] = True

    extra: float = parameter("extra", "samples", "further dead time", low=0.0, high=LONGEST)

    @classmethod
    def reference(cls, seen: Seen) -> tuple[float, ...]:
        return (2.0,)
