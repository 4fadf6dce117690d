"""``stiction bench … --against DIR``: the same benchmark in another worktree, in turns.

Both trees run as processes of their own, one after the other, and the order changes at every turn,
so that a machine which is busy now and then is so for both.
"""

import argparse
import dataclasses
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.errors import InputError
from stiction_studies.benches.speed.row import Row, row

Show = Callable[[float, str], None]
Case = tuple[str, str]

TURNS = 3
HERE, THERE = "this tree", "the other tree"
WHOLE = "whole run"
CPU, ELAPSED = "time of the processor", "elapsed time"


@dataclasses.dataclass(frozen=True)
class Ran:
    """One run of one tree.

    Attributes:
        times: ms by case and subject: the medians of its rows, and the whole run.
        yardsticks: ms of what the rows are measured against, by the same names.
    """

    times: dict[Case, float]
    yardsticks: dict[Case, float]


@dataclasses.dataclass(frozen=True)
class Turns:
    """Runs of both trees.

    Attributes:
        here, there: runs of this tree and of the other one, as many of each.
    """

    here: tuple[Ran, ...]
    there: tuple[Ran, ...]

    def rows(self) -> list[Row]:
        """Return a row for each subject that both have measured; the other is the baseline."""
        both = [case for case in self.here[0].times if case in self.there[0].times]
        return [self._row(case) for case in both]

    def _row(self, case: Case) -> Row:
        mine, theirs = ([ran.times[case] for ran in side] for side in (self.here, self.there))
        note = f"medians of {len(mine)} runs"
        if case in self.here[0].yardsticks:
            sides = (self.there, self.here)
            old, new = (np.median([ran.yardsticks[case] for ran in side]) for side in sides)
            note += f"; what each tree measures itself against: {old / new:.3f}"
        return row(case[0], (f"{case[1]}, {HERE}", THERE), mine, theirs, note)

    def alone(self) -> list[str]:
        """Return a sentence for each tree that has cases of its own."""
        mine, theirs = self.here[0].times, self.there[0].times
        return [
            f"{name} alone has {', '.join(f'{case} ({subject})' for case, subject in extra)}"
            for name, extra in (
                (HERE, [case for case in mine if case not in theirs]),
                (THERE, [case for case in theirs if case not in mine]),
            )
            if extra
        ]


def python_of(directory: Path) -> Path:
    """Return the interpreter of a worktree's own environment.

    Raises:
        InputError: it has none.
    """
    python = directory / ".venv" / "bin" / "python"
    if not python.is_file():
        raise InputError(
            "has no environment of its own",
            where=f"--against {directory}",
            fix="run make setup in it",
        )
    return python


def repeated(words: Sequence[str]) -> list[str]:
    """Return the words of a call without those that say how often it runs, and where to."""
    ours = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    for option in ("--against", "--turns", "--json"):
        ours.add_argument(option)
    return ours.parse_known_args(list(words))[1]


def alternate(words: Sequence[str], directory: Path, turns: int, show: Show) -> Turns:
    """Run a command in both trees, in turns.

    Args:
        words: of the command, ``bench`` first.
        directory: of the other worktree.
        turns: runs of each tree, 1 or more.
        show: called with the share done, 0 to 1, and what runs.

    Raises:
        InputError: no environment there, too few turns, or a run that failed.
    """
    if turns < 1:
        raise InputError(f"{turns} turns measure nothing", where="--turns", fix="use 1 or more")
    pythons = {HERE: Path(sys.executable), THERE: python_of(directory.absolute())}
    ran: dict[str, list[Ran]] = {HERE: [], THERE: []}
    for turn in range(turns):
        for name in (HERE, THERE) if turn % 2 == 0 else (THERE, HERE):
            done = sum(map(len, ran.values()))
            show(done / (2 * turns), f"turn {turn + 1} of {turns}, {name}")
            ran[name].append(run_once(pythons[name], words, name))
    return Turns(tuple(ran[HERE]), tuple(ran[THERE]))


def run_once(python: Path, words: Sequence[str], name: str) -> Ran:
    """Run a command by an interpreter and return what it took.

    Args:
        python: of the tree.
        words: of the command; what it prints as JSON is read.
        name: of the tree, for the error.
    """
    command = [str(python), "-P", "-m", "stiction_ros.cli.main", *words, "--json", "-"]
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        begun = time.perf_counter()
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=err)
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - begun
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        said, complaint = out.read().decode(), err.read().decode(errors="replace").strip()
    if process.returncode:
        last = "".join(complaint.splitlines()[-1:])
        raise InputError(
            f"{name} ended with {process.returncode}: {last}",
            where=f"stiction {' '.join(words)}",
            fix="give only what both trees can do",
        )
    times, yardsticks = measured(json.loads(said))
    times[WHOLE, CPU] = 1e3 * (usage.ru_utime + usage.ru_stime)
    times[WHOLE, ELAPSED] = 1e3 * seconds
    return Ran(times, yardsticks)


def measured(document: dict[str, Any]) -> tuple[dict[Case, float], dict[Case, float]]:
    """Return times and those of their baselines, ms, of the rows of a benchmark.

    A subject that is measured twice in one case, against two baselines, counts once. Benchmarks
    that count right answers have no such rows.
    """
    times: dict[Case, float] = {}
    yardsticks: dict[Case, float] = {}
    for told in document.get("rows", ()):
        if "subject_ms" in told and (case := (told["case"], told["subject"])) not in times:
            times[case], yardsticks[case] = told["subject_ms"], told["baseline_ms"]
    return times, yardsticks
