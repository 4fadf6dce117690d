"""What a node has noticed, shown long enough to be seen and no longer than it lasts."""

from collections.abc import Callable
from typing import NamedTuple

LEVELS = ("ok", "warn", "error")
SHOWN = 2.5  # s after the last time, so that a status at 1 Hz tells of it twice at least


def stopped_after(period: float) -> float:
    """Return the silence, s, after which a loop of this wall time per sample has stopped."""
    return max(3.0 * period, 0.5)


class Notice(NamedTuple):
    """One thing to be noticed: its name, warn or error, and a sentence."""

    name: str
    level: str
    text: str


class Noticed:
    """Conditions by name, each in force until ``shown`` seconds after it was last noticed.

    Args:
        clock: seconds that only rise, such as ``time.monotonic``.
        shown: seconds.
    """

    def __init__(self, clock: Callable[[], float], shown: float = SHOWN) -> None:
        self._clock, self._shown = clock, shown
        self._found: dict[str, tuple[str, str, float]] = {}  # level, text, and until when

    def notice(self, name: str, level: str, text: str) -> bool:
        """Note ``name`` (again) with ``level`` warn or error; tell whether it is new."""
        new = name not in self._current()
        self._found[name] = level, text, self._clock() + self._shown
        return new

    @property
    def level(self) -> str:
        """The worst level in force: ok, warn or error."""
        return max((one[0] for one in self._current().values()), key=LEVELS.index, default="ok")

    @property
    def text(self) -> str:
        """All that is in force, the worst first; empty for nothing."""
        found = sorted(self._current().values(), key=lambda one: -LEVELS.index(one[0]))
        return "; ".join(text for _, text, _ in found)

    def _current(self) -> dict[str, tuple[str, str, float]]:
        now = self._clock()
        self._found = {name: one for name, one in self._found.items() if one[2] > now}
        return self._found
