"""What is said of a valve."""

import enum


class VerdictKind(enum.StrEnum):
    """What the record says about one valve.

    Examples:
        >>> from stiction_ros import VerdictKind
        >>> VerdictKind("sticky") is VerdictKind.STICKY
        True
        >>> [kind.value for kind in VerdictKind if kind.has_friction]
        ['sticky', 'backlash']
    """

    STICKY = "sticky"
    BACKLASH = "backlash"
    HEALTHY = "healthy"
    UNDECIDED = "undecided"

    @property
    def has_friction(self) -> bool:
        """Whether friction is shown: with a jump (sticky), or without one (backlash)."""
        return self in (VerdictKind.STICKY, VerdictKind.BACKLASH)
