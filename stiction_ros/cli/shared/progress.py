"""Progress bars on a terminal, nothing elsewhere."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

Bar = Callable[..., None]
"""Shows the share of the work that is done, from 0 to 1, and what is worked at where it is told."""


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
        task = progress.add_task(text, total=1.0)
        yield lambda share, now=None: progress.update(task, completed=share, description=now)
