"""When local clocks are set forward and back, by the calendars of the zone database."""

import functools
import zoneinfo
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.intake.tables.clock import SPREADSHEET
from stiction_ros.intake.words import WORDS
from stiction_ros.texts import DAY

YEARS = SPREADSHEET[1] - SPREADSHEET[0]  # days from 1970 to 2099


class Change(NamedTuple):
    """A clock leaps from ``low`` to ``high``, or falls back and what lies between comes twice.

    Both are local, in s since 1970; ``before`` are the s that it was ahead of UTC until then.
    """

    low: float
    high: float
    back: bool
    before: float = 0.0

    @property
    def moves(self) -> float:
        """Seconds to add to what follows, for times that go on evenly."""
        return (self.high - self.low) * (1.0 if self.back else -1.0)

    @property
    def said(self) -> str:
        """What happens, as a note says it."""
        minutes = (self.high - self.low) / 60.0
        by = "an hour" if minutes == 60.0 else f"{minutes:g} min"
        way, at = ("back", self.high) if self.back else ("forward", self.low)
        return f"the clock is set {way} by {by} at {shown(at)}"


def changes(zone: str, days: FloatArray) -> list[Change]:
    """Return the changes of a zone between days since 1970, from first to last.

    Without a zone those on the days themselves, in the zones that ``words.yaml`` lists.
    """
    kept = np.unique(days[np.flatnonzero(np.diff(days, prepend=np.nan))]).clip(0.0, YEARS)
    if zone:
        kept = np.arange(kept[0], kept[-1] + 1.0)
    near = {int(day) + k for day in kept.tolist() for k in (-1, 0, 1)}
    zones = [zone] if zone else WORDS["summer_time"]
    found = {c[:3]: c for each in zones for day in near for c in _on(each, day)}
    return sorted(found.values())


def ahead(zone: str, second: float) -> float:
    """Return how many seconds the local time of a zone is ahead of UTC at a time."""
    moment = datetime.fromtimestamp(0, UTC) + timedelta(seconds=second)
    offset = moment.astimezone(zoneinfo.ZoneInfo(zone)).utcoffset()
    return offset.total_seconds() if offset is not None else 0.0


def shown(second: float) -> str:
    """Return a time, in s since 1970, as a stamp."""
    return str(datetime.fromtimestamp(0, UTC) + timedelta(seconds=round(second)))[:19]


@functools.lru_cache(1 << 16)
def _on(zone: str, day: int) -> tuple[Change, ...]:
    """Return the change on a day in UTC, if there is one."""
    first, last = round(DAY * day), round(DAY * (day + 1))
    before, after = ahead(zone, first), ahead(zone, last)
    if before == after:
        return ()
    while last - first > 1:
        middle = (first + last) // 2
        first, last = (middle, last) if ahead(zone, middle) == before else (first, middle)
    walls = sorted((last + before, last + after))
    return (Change(walls[0], walls[1], after < before, before),)
