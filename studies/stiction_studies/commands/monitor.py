"""``stiction study-monitor``: the monitor over loops in which an effect sets in half-way."""

import argparse
import dataclasses
import functools
from collections import Counter
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_studies.seeds import add_jobs, add_seeds, run_seeds

if TYPE_CHECKING:
    from stiction_ros.online.monitor.gap_monitor import MonitorRule
    from stiction_studies.blind.late import Watched


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "study-monitor",
        description="Run the monitor over long loops drawn by seed. From the middle on one effect "
        "acts, or none with --healthy. Print alarms and what was named.",
    )
    add_seeds(parser, 10000, 10019)
    parser.add_argument("--healthy", action="store_true", help="loops in which no effect sets in")
    parser.add_argument(
        "--false-alarm", type=float, metavar="P", help="monitor_false_alarm (as the node)"
    )
    add_jobs(parser)
    parser.add_argument("--json", metavar="F", help="write every run; - for stdout")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    from stiction_ros.online.monitor.gap_monitor import MonitorRule

    rule = MonitorRule(monitor=True)
    if options.false_alarm is not None:
        rule = dataclasses.replace(rule, monitor_false_alarm=options.false_alarm)
    work = functools.partial(run_seed, rule, options.healthy)
    outcomes = run_seeds(work, options.seeds, options.jobs, "monitor")
    hand_over(options.json, [_document(one) for one in outcomes], lambda: _print(outcomes))
    return 0


def run_seed(rule: "MonitorRule", healthy: bool, seed: int) -> "Watched":
    """Run one seed; a plain function, so that a worker process can run it."""
    from stiction_studies.blind.late import late_loop, watch

    return watch(late_loop(seed, healthy=healthy), rule)


def _document(one: "Watched") -> dict[str, Any]:
    return {
        "seed": one.truth.seed,
        "cause": one.truth.cause,
        "looks": list(one.looks),
        "early": one.early,
        "delay": one.delay,
        "score": one.score.value,
        "findings": [finding.to_dict() for finding in one.findings],
    }


def _print(outcomes: "list[Watched]") -> None:
    from stiction_ros.online.monitor.gap_finding import standing

    console = Console()
    table = Table(
        "seed", "process", "noise", "sets in", "early", "delay", "score", "finding that stands"
    )
    for one in outcomes:
        regime = one.truth.regime
        table.add_row(
            str(one.truth.seed),
            f"{regime.process}, {regime.tuning}",
            regime.noise,
            one.truth.cause,
            str(one.early),
            "–" if one.delay is None else str(one.delay),
            one.score.value,
            functools.reduce(standing, one.findings).text if one.findings else "",
        )
    console.print(table)
    quiet = sum(one.looks[0] for one in outcomes)
    early = sum(one.early for one in outcomes)
    with_early = sum(one.early > 0 for one in outcomes)
    console.print(
        f"nothing there: {early} of {quiet} measurements grown, in {with_early} of "
        f"{len(outcomes)} loops"
    )
    late = [one for one in outcomes if one.truth.hidden]
    if late:
        found = Counter(one.score.value for one in late)
        told = ", ".join(f"{count} {word}" for word, count in found.most_common())
        alarmed = sum(one.delay is not None for one in late)
        console.print(f"an effect set in: {alarmed} of {len(late)} alarmed; {told}")
