"""A whole survey: loops in, results as they come, the list, its pages and tables."""

import contextlib
import dataclasses
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from stiction_ros.errors import InputError, storing
from stiction_ros.intake.loop import Loop
from stiction_ros.survey.engines.engine import Engine, Task
from stiction_ros.survey.entry import Entry, SurveyOptions
from stiction_ros.survey.groups import Group, grouped, ranked
from stiction_ros.survey.journal import Journal, key_of

# told how many loops have their row, how many were read, and the last row
Progress = Callable[[int, int, Entry], None]


@dataclasses.dataclass(frozen=True)
class Survey:
    """What a survey found."""

    engine: str  # engine, workers, seconds: how it was done
    workers: int
    seconds: float
    entries: tuple[Entry, ...]  # by rank
    groups: tuple[Group, ...]  # of loops that cycle together
    date: str = ""  # when it was done, ISO
    before: int = 0  # loops that were taken from the survey that it went on with

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``survey --json``."""
        minutes = max(self.seconds, 1e-9) / 60.0
        return {
            "engine": self.engine,
            "workers": self.workers,
            "seconds": self.seconds,
            "loops_per_minute": (len(self.entries) - self.before) / minutes,
            "date": self.date,
            "before": self.before,
            "groups": [dataclasses.asdict(group) for group in self.groups],
            "loops": [entry.to_dict() for entry in self.entries],
        }


@dataclasses.dataclass(frozen=True)
class Plan:
    """How a survey is done."""

    options: SurveyOptions  # of each loop
    out: Path | None = None  # folder of journal, log and pages; None keeps nothing
    resume: bool = False  # whether what the folder holds already is not done again
    costs: Mapping[str, float] = dataclasses.field(default_factory=dict)  # ``ranking.ranked``


def survey(
    loops: Iterable[Loop], plan: Plan, engine: Engine, progress: Progress | None = None
) -> Survey:
    """Judge every loop and rank them; the engine is closed at the end, whatever happens."""
    out = plan.out
    if out is None and plan.resume:
        raise InputError("has nothing to go on from", where="--resume", fix="add --out DIR")
    begun, workers = time.perf_counter(), engine.workers
    entries: dict[str, Entry] = {}
    drawn = before = 0

    def keep(key: str, entry: Entry, log: Sequence[str]) -> None:
        entries[key] = entry
        journal.tell(entry.name, log)
        if progress is not None:
            progress(len(entries), drawn, entry)

    def tasks() -> Iterator[Task]:
        """Yield the loops that are not known yet; those that are, are taken as they are."""
        nonlocal drawn, before
        for loop in loops:
            drawn += 1
            key = key_of(loop)
            if key not in journal.known:
                yield Task(key, loop)
                continue
            before += 1
            keep(key, journal.known[key], ("taken from the survey before",))

    with (
        contextlib.nullcontext() if out is None else storing(out),
        Journal(out, plan.options.mark(), resume=plan.resume) as journal,
        contextlib.closing(engine),
    ):
        for task, found in engine.run(tasks(), plan.options):
            entry = journal.with_page(found.entry, found.page)
            if not found.again:
                journal.add(task.key, entry)
            keep(task.key, entry, found.log)
    rows, groups = grouped(sorted(entries.values(), key=lambda entry: entry.name))
    order = ranked(rows, plan.costs)
    seconds = time.perf_counter() - begun
    return Survey(engine.name, workers, seconds, tuple(order), tuple(groups), before=before)
