"""How far a survey is and how long the rest takes: loops that are done, of all that there are."""

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING

from stiction_ros.cli.shared.progress import bar

if TYPE_CHECKING:
    from stiction_ros.survey.survey import Reached

Clock = Callable[[], float]  # seconds since any time

SHARE, SECONDS = 0.1, 30.0
"""A line is printed after this share of the loops or this time, whichever comes first, where nobody
looks at a terminal."""

ENDS_WITHIN = 5.0  # seconds that counting is given to end


class Counted:
    """How many loops there are, counted beside the work."""

    def __init__(self, found: Iterable[object]) -> None:
        self.total: int | None = None
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._count, args=(found,), daemon=True)
        self._thread.start()

    def _count(self, found: Iterable[object]) -> None:
        count = 0
        with contextlib.suppress(ValueError, OSError):  # who judges the loops is told as well
            for _ in found:
                count += 1
                if self._ended.is_set():
                    return
            self.total = count

    def end(self) -> None:
        """Stop counting."""
        self._ended.set()
        self._thread.join(ENDS_WITHIN)


class Forecast:
    """Tells how far a survey is; the rest takes as long for each loop as those of this run."""

    def __init__(
        self, show: Callable[[float, str], None], total: Callable[[], int | None], clock: Clock
    ) -> None:
        """Begin now; ``show`` is given the share done, where the total is known, and words."""
        self._show, self._total, self._clock = show, total, clock
        self._begun = clock()

    def __call__(self, reached: "Reached") -> None:
        """Tell of a loop that is done."""
        total, here = self._total(), reached.done - reached.before
        if total is None:
            self._show(0.0, f"{reached.done} loops: {reached.entry.name}")
            return
        total = max(total, reached.drawn)
        words = f"{reached.done} of {total} loops"
        if here and reached.done < total:
            left = (self._clock() - self._begun) / here * (total - reached.done)
            words += f", about {_duration(left)} left"
        self._show(reached.done / total, f"{words}: {reached.entry.name}")


class Lines:
    """Prints a line now and then, where a bar would fill a file."""

    def __init__(self, clock: Clock) -> None:
        """Begin now; ``clock`` gives s."""
        self._clock, self._last, self._share = clock, clock(), 0.0

    def __call__(self, share: float, words: str) -> None:
        """Print the words if there is enough that is new."""
        now = self._clock()
        if share - self._share < SHARE - 1e-9 and now - self._last < SECONDS and share < 1.0:
            return
        self._last, self._share = now, share
        print(f"survey: {words}", file=sys.stderr, flush=True)


@contextlib.contextmanager
def progress(found: Iterable[object] | None) -> Iterator[Forecast]:
    """Show how far a survey is: a bar on a terminal, lines elsewhere.

    The loops are found once more, to be counted; None where reading them twice costs too much.
    """
    counted = None if found is None else Counted(found)
    try:
        with bar("survey") as show:
            shown = show if sys.stderr.isatty() else Lines(time.monotonic)
            yield Forecast(
                shown, lambda: None if counted is None else counted.total, time.monotonic
            )
    finally:
        if counted is not None:
            counted.end()


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
