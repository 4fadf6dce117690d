"""One thing that is hidden: where it acts, what it is called, and its figures."""

import dataclasses
from collections.abc import Mapping

Name = tuple[str, str]  # place and effect, as loop models name them

VALVE, LOAD, PROCESS = "valve:V1", "load:V1", "process:PV1"
OUTPUT, SENSOR, DATA = "disturbance:PV1", "sensor:PV1", "data"

PERIODIC = ("sine", "square", "triangle")
RANDOM = ("random_walk", "coloured")
ADDED = ("step", "bias_step", "drift", *PERIODIC)
BY_VALUES = ("quantisation", "freeze", "clip")
"""Effects that the values of PV show by themselves."""
BY_CONTROLLER = ("tuning", "time_shift")
"""Effects that OP, recomputed from PV and SP, shows by itself."""


@dataclasses.dataclass(frozen=True)
class Effect:
    """One effect."""

    place: str  # ``KIND:TAG`` or ``data``
    name: str  # of the effect, as loop models call it
    # its parameters by the names of loop models, engineering units; times count from the first
    # sample of the record
    figures: Mapping[str, float]
    # of friction or of a curve, where there are several; friction by the mechanics of a stem has no
    # figures of a loop model
    law: str = ""
    # figures that the record cannot tell, such as an end that is never reached
    untold: tuple[str, ...] = ()
    # by how much a figure may be defined otherwise, same units: lags differ by half a sample
    # between continuous time and held signals, ramps by as much at either end
    slack: Mapping[str, float] = dataclasses.field(default_factory=dict)

    @property
    def key(self) -> Name:
        """Place and effect."""
        return self.place, self.name

    @property
    def cause(self) -> str:
        """The name in tables, such as ``valve stiction karnopp``."""
        words = (self.place.partition(":")[0], self.name, self.law)
        return " ".join(word for word in words if word)

    @property
    def mechanical(self) -> bool:
        """Whether it is friction by a balance of forces."""
        return self.law in ("karnopp", "lugre")
