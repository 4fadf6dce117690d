"""What a node has noticed, shown long enough to be seen and no longer than it lasts."""

import dataclasses
from collections.abc import Callable

LEVELS = ("ok", "warn", "error")
SHOWN = 2.5  # s after the last time, so that a status at 1 Hz tells of it twice at least


def stopped_after(period: float) -> float:
    """Return the silence, s, after which a loop of this wall time per sample has stopped."""
    return max(3.0 * period, 0.5)


@dataclasses.dataclass
class _Noticed:
    level: str
    text: str
    until: float


class Noticed:
    """Conditions by name, each in force until ``shown`` seconds after it was last noticed.

    Args:
        clock: seconds that only rise, such as ``time.monotonic``.
        shown: seconds.
    """

    def __init__(self, clock: Callable[[], float], shown: float = SHOWN) -> None:
        self._clock, self._shown = clock, shown
        self._found: dict[str, _Noticed] = {}

    def notice(self, name: str, level: str, text: str) -> bool:
        """Note ``name`` (again) with ``level`` warn or error; tell whether it is new."""
        new = name not in self._current()
        self._found[name] = _Noticed(level, text, self._clock() + self._shown)
        return new

    @property
    def level(self) -> str:
        """The worst level in force: ok, warn or error."""
        found = [noticed.level for noticed in self._current().values()]
        return max(found, key=LEVELS.index, default="ok")

    @property
    def text(self) -> str:
        """All that is in force, the worst first; empty for nothing."""
        rank = LEVELS.index
        found = sorted(self._current().values(), key=lambda one: -rank(one.level))
        return "; ".join(noticed.text for noticed in found)

    def _current(self) -> dict[str, _Noticed]:
        now = self._clock()
        self._found = {n: noticed for n, noticed in self._found.items() if noticed.until > now}
        return self._found
