"""Where the loops of a survey are judged: what engines have in common."""

import dataclasses
import queue
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from typing import Any

from stiction_ros.intake.loop import Loop
from stiction_ros.survey.assess import Assessed
from stiction_ros.survey.entry import SurveyOptions

ATTEMPTS = 3  # times that a loop is tried whose worker dies: it may kill workers


@dataclasses.dataclass(frozen=True)
class Task:
    """One loop to judge; ``key`` tells it from all others."""

    key: str
    loop: Loop


class Engine(ABC):
    """Hands loops over to workers and takes what they say."""

    name: str
    workers: int  # how many loops are judged at once

    @property
    def room(self) -> int:
        """How many loops may be handed over that were not judged yet."""
        return self.workers

    @abstractmethod
    def submit(self, task: Task, options: SurveyOptions) -> Any:
        """Hand over a loop and return its future."""

    @abstractmethod
    def outcome(self, task: Task, future: Any, attempt: int) -> Assessed | None:
        """Return what came of an attempt, from 1; None where the loop is to be tried once more."""

    @abstractmethod
    def close(self) -> None:
        """Let go of workers, whatever they are doing."""

    def run(self, tasks: Iterable[Task], options: SurveyOptions) -> Iterator[tuple[Task, Assessed]]:
        """Yield what is said of each loop as it comes; tasks are drawn no faster than needed."""
        waiting, coming = iter(tasks), queue.SimpleQueue[str]()
        given: dict[str, tuple[Task, Any, int]] = {}

        def hand_over(task: Task, attempt: int) -> None:
            future = self.submit(task, options)
            given[task.key] = task, future, attempt
            future.add_done_callback(lambda _: coming.put(task.key))

        try:
            while True:
                while len(given) < self.room and (task := next(waiting, None)) is not None:
                    hand_over(task, 1)
                if not given:
                    return
                task, future, attempt = given.pop(coming.get())
                assessed = self.outcome(task, future, attempt)
                if assessed is None:
                    hand_over(task, attempt + 1)
                else:
                    yield task, assessed
        finally:
            self.close()
