"""How far a survey is: loops that are done, of all that there are."""

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
def progress(found: Iterable[object] | None) -> Iterator[Callable[["Reached"], None]]:
    """Show how far a survey is: a bar on a terminal, lines elsewhere.

    The loops are found once more, to be counted beside the work; None where reading them twice
    costs too much.
    """
    totals: list[int] = []

    def count(loops: Iterable[object]) -> None:
        with contextlib.suppress(ValueError, OSError):  # who judges the loops is told as well
            totals.append(sum(1 for _ in loops))

    def tell(reached: "Reached") -> None:
        if not totals:
            shown(0.0, f"{reached.done} loops: {reached.entry.name}")
            return
        total = max(totals[0], reached.drawn)
        shown(reached.done / total, f"{reached.done} of {total} loops: {reached.entry.name}")

    if found is not None:
        threading.Thread(target=count, args=(found,), daemon=True).start()
    with bar("survey") as show:
        shown = show if sys.stderr.isatty() else Lines(time.monotonic)
        yield tell
