"""Where the loops of a survey are judged: what engines have in common."""

import dataclasses
from collections.abc import Iterable, Iterator
from typing import Protocol

from stiction_ros.intake.loop import Loop
from stiction_ros.survey.assess import Assessed
from stiction_ros.survey.entry import Entry, Status, SurveyOptions

ATTEMPTS = 3  # times that a loop is tried whose worker dies: it may kill workers


@dataclasses.dataclass(frozen=True)
class Task:
    """One loop to judge; ``key`` tells it from all others."""

    key: str
    loop: Loop


@dataclasses.dataclass(frozen=True)
class Done:
    """One loop that was judged; ``again`` where a survey that goes on should try it anew."""

    task: Task
    assessed: Assessed
    again: bool = False


class Engine(Protocol):
    """Anything that judges loops."""

    name: str

    @property
    def workers(self) -> int:
        """How many loops are judged at once."""
        ...

    def run(self, tasks: Iterable[Task], options: SurveyOptions) -> Iterator[Done]:
        """Yield what is said of each loop as it comes; tasks are drawn no faster than needed."""
        ...

    def close(self) -> None:
        """Let go of workers, whatever they are doing."""
        ...


def lost(task: Task, reason: str, *, again: bool = False) -> Done:
    """Return a loop that could not be judged, for a reason that may pass when tried ``again``."""
    loop = task.loop
    entry = Entry(
        loop.name,
        tuple(str(file) for file in loop.files),
        Status.FAILED,
        reason,
        notes=tuple(loop.notes),
    )
    return Done(task, Assessed(entry, log=(f"failed: {reason}",)), again)
