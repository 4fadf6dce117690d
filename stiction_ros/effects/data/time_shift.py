"""A record whose PV comes too late."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import parameter
from stiction_ros.effects.delays import LONGEST, Delay


@dataclasses.dataclass(frozen=True)
class TimeShift(Delay):
    r"""PV is recorded too late against OP: y_k = (1 − f) x_{k−n} + f x_{k−n−1}.

    The loop itself does not feel it; a controller that is recomputed from PV and SP does.
    """

    effect: ClassVar[str] = "time_shift"
    places: ClassVar[tuple[str, ...]] = ("data",)
    experiment: ClassVar[str] = "record SP, and the tuning as it is written down"
    separation: ClassVar[str] = (
        "record the set-point and the controller's tuning, or put OP and PV on one clock"
    )
    not_searched: ClassVar[str] = (
        "OP recomputed from PV and SP shows it, where both and a tuning are recorded"
    )

    shift: float = parameter("shift", "samples", "lateness of PV", low=0.0, high=LONGEST)
