"""How often a method finds the friction of the paper's examples, counted and kept as JSON.

A run is right when every f_S and f_D, those of the healthy valve included, is within ``RIGHT``.
Runs are kept one by one, each with its seed, so that a long count can be made in pieces.
"""

import dataclasses
import json
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.identification import identify as identify_by_own
from stiction_ros.paper.methods import identify
from stiction_ros.paper.search_log import PaperIdentification
from stiction_studies.paper.settings import printed_example

RIGHT = 0.15
OWN = ("exact", "evidence")
METHODS = (*OWN, "nlp", "nlp_printed", "grid")
FILE = "paper_success.json"


@dataclasses.dataclass(frozen=True)
class Trial:
    """One seed of one example by one method.

    Attributes:
        example, method, seed: what was run.
        friction: (f_S, f_D) found per valve, %.
        error: largest distance from the truth, %.
        delays: t_d found, output by output, valve by valve, samples.
        squared_error: (12a) as the method found it, squared engineering units; None for our own
            searches.
        seconds: wall clock.
        solves, capped, points: runs of IPOPT, those that ended at their limit, evaluations.
    """

    example: int
    method: str
    seed: int
    friction: tuple[tuple[float, float], ...]
    error: float
    delays: tuple[int, ...]
    squared_error: float | None
    seconds: float
    solves: int
    capped: int
    points: int

    @property
    def key(self) -> tuple[int, str, int]:
        """What makes two trials the same."""
        return self.example, self.method, self.seed

    @property
    def right(self) -> bool:
        """Whether every friction is within ``RIGHT``."""
        return self.error <= RIGHT


@dataclasses.dataclass(frozen=True)
class Rate:
    """Trials of one example by one method.

    Attributes:
        right, total: numbers of trials.
        delay_right: those whose delays are all the printed one.
        seconds: median.
        seeds: first and last.
    """

    example: int
    method: str
    right: int
    total: int
    delay_right: int
    seconds: float
    seeds: tuple[int, int]


@dataclasses.dataclass(frozen=True)
class Success:
    """All trials that were kept, and the commands that made them."""

    trials: tuple[Trial, ...] = ()
    commands: tuple[str, ...] = ()

    @classmethod
    def load(cls, path: Path) -> "Success":
        """Read what :meth:`save` wrote; InputError where it is something else."""
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            return cls(tuple(_trial(entry) for entry in found["trials"]), tuple(found["commands"]))
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(
                f"holds no count of the paper's examples ({error})", where=str(path)
            ) from None

    def with_trials(self, trials: Iterable[Trial], command: str) -> "Success":
        """Return this with more trials; the newer of two of the same seed stays."""
        kept = {trial.key: trial for trial in (*self.trials, *trials)}
        commands = (*self.commands, *([] if command in self.commands else [command]))
        return Success(tuple(kept[key] for key in sorted(kept)), commands)

    def save(self, path: Path) -> None:
        """Write JSON, a trial a line."""
        rows = [json.dumps(dataclasses.asdict(trial)) for trial in self.trials]
        text = ",\n".join(f"  {row}" for row in rows)
        commands = json.dumps(list(self.commands), indent=1)
        path.write_text(f'{{"commands": {commands},\n"trials": [\n{text}\n]}}\n', encoding="utf-8")

    def rates(self) -> tuple[Rate, ...]:
        """Return one count for each example and method, in their order."""
        found = []
        for number in (1, 2):
            for method in METHODS:
                chosen = [t for t in self.trials if (t.example, t.method) == (number, method)]
                if chosen:
                    found.append(_rate(chosen))
        return tuple(found)


def run_trial(number: int, method: str, seed: int) -> Trial:
    """Make one record at the paper's settings and identify it."""
    printed = printed_example(number)
    example = printed.make(seed)
    begun = time.perf_counter()
    if method in OWN:
        found = identify_by_own(example.record, dataclasses.replace(example.options, method=method))
    else:
        found = identify(example.record, printed.options(example, method))
    seconds = time.perf_counter() - begun
    friction = np.array([[v.static_friction, v.dynamic_friction] for v in found.valves])
    true = np.array([example.friction(valve.name) for valve in found.valves])
    log = found.search if isinstance(found, PaperIdentification) else None
    return Trial(
        example=number,
        method=method,
        seed=seed,
        friction=tuple((round(float(a), 4), round(float(b), 4)) for a, b in friction),
        error=round(float(np.abs(friction - true).max()), 4),
        delays=tuple(delay for output in found.outputs for delay in output.delay.values()),
        squared_error=round(log.objective, 6) if log and np.isfinite(log.objective) else None,
        seconds=round(seconds, 3),
        solves=len(log.starts) if log else 0,
        capped=log.capped if log else 0,
        points=log.points if log else 0,
    )


def _rate(trials: Sequence[Trial]) -> Rate:
    first = trials[0]
    wanted = printed_example(first.example).delay
    seeds = [trial.seed for trial in trials]
    return Rate(
        example=first.example,
        method=first.method,
        right=sum(trial.right for trial in trials),
        total=len(trials),
        delay_right=sum(set(trial.delays) == {wanted} for trial in trials),
        seconds=float(np.median([trial.seconds for trial in trials])),
        seeds=(min(seeds), max(seeds)),
    )


def _trial(entry: dict[str, Any]) -> Trial:
    friction = tuple((float(a), float(b)) for a, b in entry["friction"])
    return Trial(**{**entry, "friction": friction, "delays": tuple(entry["delays"])})
