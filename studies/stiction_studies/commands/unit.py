"""``stiction study`` of several loops on one plant: the valve named, and what the swap ends."""

import argparse
import functools
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_studies.commands.live_log import log_of
from stiction_studies.seeds import run_seeds

if TYPE_CHECKING:
    from stiction_ros.online.unit import UnitScenario

Outcome = dict[str, Any]


def run_seed(scenario: "UnitScenario", seed: int, *, ideal_valves: bool) -> Outcome:
    """Run one seed; a plain function, so that a worker process can run it."""
    from stiction_ros.online.unit import run_unit
    from stiction_ros.survey.unit import unit_report, unit_rows

    runs = run_unit(scenario, seed=seed, ideal_valves=ideal_valves)
    logs = {name: log_of(live) for name, live in runs.items()}
    report = unit_report(logs, scenario)
    return {
        "seed": seed,
        "swap": {name: log.swap_sample for name, log in logs.items()},
        "trusted": {name: sum(bool(f.trusted) for f in log.fits) for name, log in logs.items()},
        "sources": dict(report.found.sources),
        "sentences": report.found.sentences,
        "rows": [[c if isinstance(c, str) else c[1] for c in row] for row in unit_rows(report)],
    }


def run(scenario: "UnitScenario", options: argparse.Namespace) -> int:
    """Run all seeds and print them; return 1 where another valve was named or trusted."""
    work = functools.partial(run_seed, scenario, ideal_valves=options.ideal_valves)
    outcomes = run_seeds(work, options.seeds, options.jobs, scenario.name)
    valves = () if options.ideal_valves else scenario.simulated.plant.valves
    effects = {valve.name for valve in valves if valve.effects}
    at_fault = [loop.name for loop in scenario.loops if effects & set(loop.valves)]
    hand_over(options.json, outcomes, lambda: _print(scenario.name, outcomes))
    right = [
        list(one["sources"]) == at_fault == [name for name, n in one["trusted"].items() if n]
        for one in outcomes
    ]
    if options.json != "-":
        print(f"{sum(right)} of {len(right)} runs name and trust {at_fault} alone")
    return 0 if all(right) else 1


def _print(name: str, outcomes: list[Outcome]) -> None:
    from stiction_ros.survey.unit import UNIT_COLUMNS

    table = Table("seed", "swap", "trusted", *UNIT_COLUMNS, title=name, title_justify="left")
    for one in outcomes:
        for name, *row in one["rows"]:
            told = one["seed"], one["swap"][name], one["trusted"][name]
            table.add_row(*map(str, told), name, *row)
        table.add_section()
    Console(width=150).print(table)
