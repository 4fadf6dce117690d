"""Progress bars on a terminal, nothing elsewhere."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn


class Bar:
    """One bar, from 0 to 1."""

    def __init__(self, progress: Progress, task: int) -> None:
        self._progress, self._task = progress, task

    def __call__(self, share: float, text: str | None = None) -> None:
        """Show that ``share`` of the work is done."""
        self._progress.update(self._task, completed=share)  # type: ignore[arg-type]
        if text is not None:
            self._progress.update(self._task, description=text)  # type: ignore[arg-type]


@contextmanager
def bar(text: str) -> Iterator[Bar]:
    """Show a bar on standard error while it is a terminal."""
    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not sys.stderr.isatty(),
    ) as progress:
        yield Bar(progress, progress.add_task(text, total=1.0))
