"""``stiction faults --opcua``: faults between a control system and its bridge."""

import argparse
import dataclasses
import functools
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.node_processes import require_ros, ros_environment
from stiction_ros.errors import InputError
from stiction_studies.commands.fault_cases import keep, shown_seconds
from stiction_studies.seeds import run_each

if TYPE_CHECKING:
    from stiction_studies.faults.bridge.case import BridgeOutcome

WIDE = 130  # characters of the table in a file
DOMAINS = 101  # of ROS whose ports lie below those that systems give away by themselves


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    from stiction_ros.opcua import require_asyncua
    from stiction_studies.faults.bridge.catalogue import FAULTS, find, table

    for key in ("pace", "phase"):
        if getattr(options, key) is not None:
            raise InputError("has no meaning with --opcua", where=f"--{key}", fix="leave it out")
    if not (options.all or options.only):
        print(table(), end="")
        return 0
    faults = FAULTS if options.all else tuple(find(name) for name in options.only)
    require_ros()
    require_asyncua()
    first = int(ros_environment()["ROS_DOMAIN_ID"])
    asked = [_Asked(fault.name, first + place) for place, fault in enumerate(faults)]
    work = functools.partial(_run, Path(options.out or "out/faults"), options.seed)
    outcomes = run_each(work, asked, options.jobs, f"faults: {len(asked)} cases")
    hand_over(options.json, [outcome.to_dict() for outcome in outcomes], lambda: _print(outcomes))
    return 0 if all(outcome.passed for outcome in outcomes) else 1


@dataclasses.dataclass(frozen=True)
class _Asked:
    """One case as a worker process can be given it; those that run at a time differ in domain."""

    fault: str
    domain: int


def _run(kept: Path, seed: int, asked: _Asked) -> "BridgeOutcome":
    from stiction_studies.faults.bridge.case import run_case
    from stiction_studies.faults.bridge.catalogue import find

    os.environ["ROS_DOMAIN_ID"] = str(asked.domain % DOMAINS)
    with tempfile.TemporaryDirectory(prefix="stiction_fault_") as folder:
        outcome = run_case(find(asked.fault), Path(folder), seed)
        if not outcome.passed:
            keep(Path(folder), kept / asked.fault)
    return outcome


def _print(outcomes: "Sequence[BridgeOutcome]") -> None:
    from rich.console import Console
    from rich.table import Column, Table

    console = Console(width=None if sys.stdout.isatty() else WIDE)
    shown = Table(
        Column("fault", overflow="fold", min_width=24),
        *("OPs (limited)", "no grant", "beyond, %", "refused", "PI after, s", "step, %"),
        *("told, s", "back, s", "not in bag", "verdict"),
    )
    for one in outcomes:
        shown.add_row(
            one.fault,
            f"{one.ops} ({one.limited})",
            str(one.ungranted),
            f"{one.beyond:.2f}",
            str(one.refused),
            shown_seconds(one.in_charge),
            f"{one.step:.2f}",
            shown_seconds(one.noticed),
            shown_seconds(one.back),
            f"{one.bag.missing} of {one.bag.expected}",
            "pass" if one.passed else "FAIL",
        )
    console.print(shown)
    for one in outcomes:
        if one.said:
            console.print(f"{one.fault}: {one.said}", markup=False)
        for reason in one.reasons:
            console.print(f"{one.fault} FAILS: {reason}", markup=False)
    passed = sum(one.passed for one in outcomes)
    seconds = sum(one.seconds for one in outcomes)
    console.print(f"{passed} of {len(outcomes)} cases pass, {seconds / 60:.1f} minutes of loops")
