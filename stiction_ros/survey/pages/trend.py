"""How the bands of loops went over earlier surveys."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence

from stiction_ros.pages.plot import spark
from stiction_ros.survey.entry import Entry
from stiction_ros.survey.pages.words import figure, op_figure


@dataclasses.dataclass(frozen=True)
class Earlier:
    """An earlier survey: its date, ISO or empty, and f_S + f_D of its loops in the unit of OP."""

    date: str
    bands: Mapping[str, float | None]

    @property
    def day(self) -> str:
        """Return its date without the time of day, or that it is earlier."""
        return self.date[:10] or "earlier"


@dataclasses.dataclass(frozen=True)
class Trend:
    """The band of one loop, the oldest first: when, and how wide."""

    entry: Entry
    steps: tuple[tuple[str, float], ...]

    @property
    def change(self) -> float:
        """Return by how much the band grew, in the unit of OP."""
        return self.steps[-1][1] - self.steps[0][1]

    @property
    def words(self) -> str:
        """Return the first and the last band."""
        first, last = figure(self.steps[0][1]), op_figure(self.steps[-1][1], self.entry.op_unit)
        return last if len(self.steps) == 1 else f"{first} → {last}"

    @property
    def told(self) -> str:
        """Return every band with its date."""
        return ", ".join(f"{day}: {figure(band)}" for day, band in self.steps)

    def line(self, most: float) -> str:
        """Return the small line of the bands as HTML, from 0 to ``most``."""
        return spark([band for _, band in self.steps], most)


def trend_of(entry: Entry, earlier: Sequence[Earlier]) -> Trend | None:
    """Return the trend of a loop; None where no earlier survey, the oldest first, has its band."""
    steps = [(one.day, band) for one in earlier if (band := one.bands.get(entry.name)) is not None]
    if not steps:
        return None
    if entry.f_s is not None and entry.f_d is not None:
        steps.append(("now", entry.f_s + entry.f_d))
    return Trend(entry, tuple(steps))


def widest(trends: Iterable[Trend | None], op_unit: str) -> float:
    """Return the widest band of all trends in one unit of OP: the end of their common scale."""
    kept = [trend for trend in trends if trend is not None and trend.entry.op_unit == op_unit]
    return max((band for trend in kept for _, band in trend.steps), default=0.0)


def new_and_gone(
    entries: Iterable[Entry], earlier: Sequence[Earlier]
) -> tuple[list[str], list[str]]:
    """Return the loops that the last survey did not have, and those that are no longer there."""
    if not earlier:
        return [], []
    now, before = {entry.name for entry in entries}, set(earlier[-1].bands)
    return sorted(now - before), sorted(before - now)
