"""What a control system says of one tag: a value, how good it is, and since when it holds."""

import dataclasses
import enum
import math

LOCAL_OVERRIDE = 0x00960000  # OPC UA part 8: put in by hand, so it is no measurement


class TagQuality(enum.IntEnum):
    """How good a value is, the best first; the number stands in ``effort`` of ``pv``."""

    GOOD = 0
    UNCERTAIN = 1  # such as a last usable value, or one put in by hand
    BAD = 2
    SILENT = 3  # nothing is heard of the server, or nothing was ever heard of the tag


@dataclasses.dataclass(frozen=True, slots=True)
class TagReading:
    """One report of one tag."""

    value: float | str | None  # as it was sent; None when there was none
    quality: TagQuality  # of the value
    stamp: int  # source time stamp, ns
    first: bool = False  # whether it opens a subscription: the present value, maybe long past

    @property
    def number(self) -> float:
        """The value as a finite number, else NaN."""
        if isinstance(self.value, str) or self.value is None:
            return math.nan
        return float(self.value) if math.isfinite(self.value) else math.nan


def quality_of(status: int) -> TagQuality:
    """Return the quality that an OPC UA status code (32 bits) stands for."""
    severity = status >> 30
    if severity == 0:
        overridden = status & 0xFFFF0000 == LOCAL_OVERRIDE
        return TagQuality.UNCERTAIN if overridden else TagQuality.GOOD
    return TagQuality.UNCERTAIN if severity == 1 else TagQuality.BAD
