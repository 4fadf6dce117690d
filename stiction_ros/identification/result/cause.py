"""What makes an output oscillate, as a value."""

import dataclasses
import enum


class CauseKind(enum.StrEnum):
    """What an oscillation comes from.

    ``VALVE``: the friction that was identified. ``TUNING``: controller and process ring
    without it. ``DISTURBANCE``: a wave that enters behind the valve. ``SET_POINT``: moves of
    the set-point. ``NONE``: there is no regular oscillation. ``UNKNOWN``: there is one and
    nothing explains it.
    """

    VALVE = "valve"
    TUNING = "tuning"
    DISTURBANCE = "disturbance"
    SET_POINT = "set_point"
    NONE = "none"
    UNKNOWN = "unknown"


@dataclasses.dataclass(frozen=True)
class Cause:
    """Why one output oscillates."""

    kind: CauseKind  # see ``CauseKind``
    period: float | None  # of PV − SP, s; None where nothing stands out
    regularity: float  # above 1 is regular, see ``stiction_ros.signals.oscillation``
    amplitude: float  # √2 × RMS of the line at this period, engineering units
    sentence: str  # for people

    def to_dict(self) -> dict[str, str | float | None]:
        """Return the mapping of ``identify --json``."""
        return {
            "kind": self.kind.value,
            "period": self.period,
            "regularity": self.regularity,
            "amplitude": self.amplitude,
        }
