"""A whole survey: loops in, results as they come, the list, its pages and tables."""

import dataclasses
import itertools
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from stiction_ros.errors import InputError, storing
from stiction_ros.intake.loop import Loop
from stiction_ros.survey.engines.engine import Engine, Task
from stiction_ros.survey.entry import Entry, Status, SurveyOptions
from stiction_ros.survey.groups import Group, grouped, ranked
from stiction_ros.survey.journal import Journal, key_of

PAGES = "loops"
LOG = "survey.log"


@dataclasses.dataclass(frozen=True)
class Reached:
    """How far a survey is."""

    done: int  # loops that have their row
    drawn: int  # loops that were read
    entry: Entry  # the last row


Progress = Callable[[Reached], None]


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

    @property
    def judged(self) -> int:
        """How many loops were judged, in this run or before."""
        return sum(entry.status is Status.OK for entry in self.entries)

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
    if plan.out is None:
        if plan.resume:
            raise InputError("has nothing to go on from", where="--resume", fix="add --out DIR")
        return _Run(plan, engine, None, None).done(loops, progress)
    with storing(plan.out):
        (plan.out / PAGES).mkdir(parents=True, exist_ok=True)
        with (
            Journal(plan.out, plan.options.mark(), resume=plan.resume) as journal,
            (plan.out / LOG).open("a" if plan.resume else "w", encoding="utf-8") as log,
        ):
            found = _Run(plan, engine, journal, log).done(loops, progress)
    return found


class _Run:
    """One survey on its way."""

    def __init__(
        self, plan: Plan, engine: Engine, journal: Journal | None, log: IO[str] | None
    ) -> None:
        self.plan, self.engine, self.journal, self.log = plan, engine, journal, log
        self.entries: dict[str, Entry] = {}
        self.drawn = self.before = 0
        self._pages: set[str] = set()

    def done(self, loops: Iterable[Loop], progress: Progress | None) -> Survey:
        begun, workers = time.perf_counter(), self.engine.workers
        tasks = self._tasks(loops, progress)
        try:
            for done in self.engine.run(tasks, self.plan.options):
                entry = self._kept(done.assessed.entry, done.assessed.page)
                self.entries[done.task.key] = entry
                if self.journal is not None and not done.again:
                    self.journal.add(done.task.key, entry)
                self._tell(entry.name, done.assessed.log)
                self._show(progress, entry)
        finally:
            self.engine.close()
        rows, groups = grouped(sorted(self.entries.values(), key=lambda entry: entry.name))
        order = ranked(rows, self.plan.costs)
        seconds = time.perf_counter() - begun
        return Survey(
            self.engine.name, workers, seconds, tuple(order), tuple(groups), before=self.before
        )

    def _show(self, progress: Progress | None, entry: Entry) -> None:
        if progress is not None:
            progress(Reached(len(self.entries), self.drawn, entry))

    def _tasks(self, loops: Iterable[Loop], progress: Progress | None) -> Iterator[Task]:
        """Yield the loops that are not known yet; those that are, are taken as they are."""
        for loop in loops:
            self.drawn += 1
            key = key_of(loop)
            known = None if self.journal is None else self.journal.known.get(key)
            if known is None:
                yield Task(key, loop)
                continue
            self.entries[key] = known
            self.before += 1
            if known.report is not None:
                self._pages.add(Path(known.report).name)
            self._tell(known.name, ("taken from the survey before",))
            self._show(progress, known)

    def _kept(self, entry: Entry, page: str) -> Entry:
        """Write the page of a loop and return the entry that names it."""
        if not page or self.plan.out is None:
            return entry
        name = self._page_name(entry.name)
        (self.plan.out / PAGES / name).write_text(page, encoding="utf-8")
        return dataclasses.replace(entry, report=f"{PAGES}/{name}")

    def _page_name(self, loop: str) -> str:
        base = re.sub(r"[^\w.-]+", "_", loop).strip("._")[:80] or "loop"
        names = itertools.chain([base], (f"{base}-{k}" for k in itertools.count(2)))
        name = next(f"{n}.html" for n in names if f"{n}.html" not in self._pages)
        self._pages.add(name)
        return name

    def _tell(self, name: str, sentences: Sequence[str]) -> None:
        if self.log is None:
            return
        for sentence in sentences:
            line = " ".join(sentence.split())
            self.log.write(f"{name}: {line}\n")
        self.log.flush()
