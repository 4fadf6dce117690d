"""``stiction faults``: faults put into a running graph, and what becomes of it."""

import argparse
import dataclasses
import functools
import os
import signal
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.node_processes import require_ros, ros_environment
from stiction_ros.errors import InputError
from stiction_studies.commands.fault_cases import keep, shown_seconds
from stiction_studies.faults.fault import Fault
from stiction_studies.faults.terms import Pace, Phase
from stiction_studies.seeds import run_each

if TYPE_CHECKING:
    from stiction_studies.faults.judgement.judge import Outcome

DOMAINS = 101  # of ROS whose ports lie below those that systems give away by themselves
Case = tuple[Fault, Pace, Phase]


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "faults",
        description="Start the nodes of a loop as processes, put one fault into it, and hold "
        "what is seen against what is expected: before and after the swap, in both paces. "
        "Without --only and --all print the table of all faults. "
        "docs/faults.md tells all of them, docs/opcua.md those with --opcua.",
    )
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--only", action="append", metavar="NAME", help="one fault; may be repeated")
    which.add_argument("--all", action="store_true", help="every fault (up to an hour)")
    parser.add_argument(
        "--opcua",
        action="store_true",
        help="faults between a control system and its bridge, in place of faults of the loop",
    )
    parser.add_argument("--pace", choices=[p.value for p in Pace], help="only in this pace")
    parser.add_argument(
        "--phase", choices=[p.value for p in Phase], help="only on this side of the swap"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the noise (1)")
    parser.add_argument(
        "--speed", type=float, default=25.0, metavar="N", help="speed in realtime pace (25)"
    )
    parser.add_argument(
        "--two-loops",
        action="store_true",
        help="in lockstep, with a second loop whose OP must be that of a run without faults",
    )
    parser.add_argument(
        "--out", metavar="DIR", help="folder for logs and bags of cases that fail (out/faults)"
    )
    parser.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="loops that run at a time (1)"
    )
    parser.add_argument("--json", metavar="F", help="write every outcome; - for stdout")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    if options.jobs < 1:
        raise InputError(f"{options.jobs} is not positive", where="--jobs")
    signal.signal(signal.SIGTERM, _interrupt)
    if options.opcua:
        from stiction_studies.commands import faults_opcua

        return faults_opcua.run(options)
    from stiction_studies.faults.catalogue import FAULTS, find, table

    if not (options.all or options.only):
        print(table(), end="")
        return 0
    faults = FAULTS if options.all else tuple(find(name) for name in options.only)
    cases = [
        (fault, pace, phase)
        for fault in faults
        for pace, phase in fault.cases
        if options.pace in (None, pace.value) and options.phase in (None, phase.value)
        if pace is Pace.LOCKSTEP or not options.two_loops
    ]
    if not cases:
        raise InputError("no case is left", fix="leave --pace and --phase out")
    if not options.speed > 0.0:
        raise InputError(f"{options.speed:g} is not positive", where="--speed")
    require_ros()
    outcomes = run_cases(cases, options)
    hand_over(options.json, [outcome.to_dict() for outcome in outcomes], lambda: _print(outcomes))
    return 0 if outcomes and all(outcome.passed for outcome in outcomes) else 1


def run_cases(cases: Sequence[Case], options: argparse.Namespace) -> "list[Outcome]":
    """Run every case, ``--jobs`` at a time; logs and bags of those that fail are kept."""
    first = int(ros_environment()["ROS_DOMAIN_ID"])
    asked = [
        _Asked(fault.name, pace, phase, first + place)
        for place, (fault, pace, phase) in enumerate(cases)
    ]
    kept = Path(options.out or "out/faults")
    work = functools.partial(_run, kept, options.seed, options.speed, options.two_loops)
    return run_each(work, asked, options.jobs, f"faults: {len(cases)} cases")


@dataclasses.dataclass(frozen=True)
class _Asked:
    """One case as a worker process can be given it; those that run at a time differ in domain."""

    fault: str
    pace: Pace
    phase: Phase
    domain: int

    @property
    def title(self) -> str:
        return f"{self.fault}-{self.pace}-{self.phase}"


def _run(kept: Path, seed: int, speed: float, two: bool, asked: _Asked) -> "Outcome":
    from stiction_studies.faults.case import Options, run_case
    from stiction_studies.faults.catalogue import find

    os.environ["ROS_DOMAIN_ID"] = str(asked.domain % DOMAINS)
    with tempfile.TemporaryDirectory(prefix="stiction_fault_") as folder:
        settings = Options(seed, speed, two)
        outcome = run_case(find(asked.fault), asked.pace, asked.phase, Path(folder), settings)
        if not outcome.passed:
            keep(Path(folder), kept / asked.title)
    return outcome


def _print(outcomes: "Sequence[Outcome]") -> None:
    from rich.console import Console
    from rich.table import Column, Table

    console = Console()
    shown = Table(
        Column("fault", overflow="fold", min_width=24),
        *("pace", "swap", "OP beyond, %", "without OP, s", "noticed, s", "recovered, s"),
        *("bag", "verdict"),
    )
    for one in outcomes:
        recovered = "ended" if one.ended else shown_seconds(one.recovered)
        shown.add_row(
            one.fault,
            one.pace.value,
            one.phase.value,
            f"{one.beyond:.2f}",
            shown_seconds(one.without),
            shown_seconds(one.noticed),
            recovered,
            "yes" if one.bag else "no",
            "pass" if one.passed else "FAIL",
        )
    console.print(shown)
    for one in outcomes:
        for reason in one.reasons:
            console.print(f"{one.fault}, {one.pace}, {one.phase}: {reason}", markup=False)
    passed = sum(one.passed for one in outcomes)
    seconds = sum(one.seconds for one in outcomes)
    console.print(f"{passed} of {len(outcomes)} cases pass, {seconds / 60:.1f} minutes of loops")


def _interrupt(_number: int, _frame: Any) -> None:
    raise KeyboardInterrupt
