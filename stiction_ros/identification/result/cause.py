"""What makes an output oscillate, as a value."""

from __future__ import annotations

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
    """Why one output oscillates.

    Attributes:
        kind: see :class:`CauseKind`.
        period: of PV − SP, s; None where nothing stands out.
        regularity: above 1 is regular, see
            :mod:`stiction_ros.signals.oscillation`.
        amplitude: √2 × RMS of the line at this period, engineering units.
        sentence: for people.
    """

    kind: CauseKind
    period: float | None
    regularity: float
    amplitude: float
    sentence: str

    def to_dict(self) -> dict[str, str | float | None]:
        """Return the mapping of ``identify --json``."""
        return {
            "kind": self.kind.value,
            "period": self.period,
            "regularity": self.regularity,
            "amplitude": self.amplitude,
        }
