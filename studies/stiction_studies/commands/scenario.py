"""``stiction study``: a scenario over many seeds, by the core without ROS."""

import argparse
import dataclasses
import functools
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.scenarios import find
from stiction_studies.seeds import add_jobs, add_seeds, run_seeds

if TYPE_CHECKING:
    from stiction_ros.online.session import Scenario

WIDTH = 132  # characters that the table needs


@dataclasses.dataclass(frozen=True)
class Outcome:
    """One seed."""

    seed: int  # of the noise
    summary: dict[str, Any]  # as in ``summary.json`` of the demo

    def ratio(self, output: str, key: str, baseline: str) -> float:
        """Return a score of ``after`` over that of another phase; NaN when there is none."""
        phases = self.summary["phases"]
        try:
            return float(phases["after"][output][key] / phases[baseline][output][key])
        except (KeyError, TypeError, ZeroDivisionError):
            return float("nan")

    def work(self, valve: str, key: str, phase: str) -> float:
        """Return the work of a valve in a phase, per hour; NaN when there is none."""
        found = self.summary["valve_work"].get(phase, {}).get(valve, {})
        return float(found.get(key, "nan"))

    def op_step(self, valve: str, phase: str) -> float:
        """Return the largest move of OP in a phase, %; NaN when there is none."""
        return float(self.summary["largest_op_step"].get(phase, {}).get(valve, "nan"))


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "study",
        description="Run a scenario's live loop over seeds by the core, without ROS, and print "
        "what was identified and what the swap gained. Exit code 1 when a loop with sticky valves "
        "was not swapped, one with ideal valves was, or a wrong one of several named or trusted.",
    )
    parser.add_argument("scenario", metavar="SCENARIO", help="a scenario of demo, or a file")
    add_seeds(parser, 11, 20)
    parser.add_argument("--ideal-valves", action="store_true", help="valves that follow OP")
    add_jobs(parser)
    parser.add_argument("--json", metavar="F", help="write all summaries; - for stdout")
    parser.set_defaults(run=run)


def run_seed(scenario: "Scenario", seed: int, *, ideal_valves: bool) -> Outcome:
    """Run one seed; a plain function, so that a worker process can run it."""
    from stiction_ros.online.session import run_live
    from stiction_ros.report.run.story import summary, tell
    from stiction_studies.commands.live_log import log_of

    chosen = dataclasses.replace(scenario, seed=seed)
    live = run_live(chosen, ideal_valves=ideal_valves)
    return Outcome(seed, summary(tell(log_of(live), scenario=chosen)))


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    path = find(options.scenario)
    from stiction_ros.online.session import Scenario
    from stiction_ros.online.unit import load_scenario

    scenario = load_scenario(path)
    if not isinstance(scenario, Scenario):
        from stiction_studies.commands import unit

        return unit.run(scenario, options)
    work = functools.partial(run_seed, scenario, ideal_valves=options.ideal_valves)
    outcomes = run_seeds(work, options.seeds, options.jobs, scenario.name)
    hand_over(
        options.json, [outcome.summary for outcome in outcomes], lambda: _print(scenario, outcomes)
    )
    swapped = sum(outcome.summary["swap_time"] is not None for outcome in outcomes)
    return 0 if swapped == (0 if options.ideal_valves else len(outcomes)) else 1


def _sticky(scenario: "Scenario") -> list[str]:
    return [valve.name for valve in scenario.plant.valves if valve.effects]


def _ratio(outcome: Outcome, valve: str, key: str) -> float:
    before = outcome.work(valve, key, "before")
    return outcome.work(valve, key, "after") / before if before else float("nan")


def _print(scenario: "Scenario", outcomes: list[Outcome]) -> None:
    console = Console()
    table = Table(title=f"{scenario.name}, {scenario.samples} samples a run", title_justify="left")
    for name in ("seed", "swap s", "valves", "delay", "output"):
        table.add_column(name)
    for name in ("amplitude after / before", "IAE after / stiction-free"):
        table.add_column(name, justify="right")
    table.add_column("valve")
    for name in ("travel %/h", "moves/h", "turns/h", "OP step %"):
        table.add_column(f"{name}\nbefore > after", justify="right")
    for outcome in outcomes:
        summary = outcome.summary
        swap = summary["swap_time"]
        head = [
            str(outcome.seed),
            "never" if swap is None else f"{swap:.0f}",
            "\n".join(
                f"{v['name']} {v['verdict']} {v['f_s']:.2f} {v['f_d']:.2f}"
                for v in summary["valves"]
            ),
            "\n".join(" ".join(map(str, d.values())) for d in summary["delay"].values()),
        ]
        outputs, tags = scenario.process.outputs, scenario.process.valve_names
        work = [
            [(outcome.work(v, key, "before"), outcome.work(v, key, "after")) for v in tags]
            for key in ("travel", "moves", "reversals")
        ]
        work.append([(outcome.op_step(v, "before"), outcome.op_step(v, "after")) for v in tags])
        table.add_row(
            *head,
            "\n".join(outputs),
            "\n".join(f"{outcome.ratio(o, 'amplitude', 'before'):.3f}" for o in outputs),
            "\n".join(f"{outcome.ratio(o, 'iae_per_hour', 'stiction_free'):.3f}" for o in outputs),
            "\n".join(tags),
            *("\n".join(f"{was:.3g} > {now:.3g}" for was, now in pairs) for pairs in work),
        )
    console.width = max(console.width, WIDTH)
    console.print(table)
    swapped = sum(outcome.summary["swap_time"] is not None for outcome in outcomes)
    console.print(f"{swapped} of {len(outcomes)} runs were swapped")
    if swapped:
        for output in scenario.process.outputs:
            worst = [
                max(outcome.ratio(output, key, phase) for outcome in outcomes)
                for key, phase in (("amplitude", "before"), ("iae_per_hour", "stiction_free"))
            ]
            console.print(
                f"{output}: amplitude at most {worst[0]:.3g} of before, "
                f"IAE at most {worst[1]:.3g} of stiction-free"
            )
        for valve in _sticky(scenario):
            told = [
                f"{key} at most {max(_ratio(o, valve, key) for o in outcomes):.3g} of before"
                for key in ("travel", "moves", "reversals")
            ]
            steps = max(outcome.op_step(valve, "after") for outcome in outcomes)
            console.print(f"{valve}: {', '.join(told)}, largest OP step {steps:.3g} %")
    for outcome in outcomes:
        if outcome.summary["status"] != "ok" and outcome.summary["swap_time"] is not None:
            console.print(f"seed {outcome.seed}: {outcome.summary['reason']}")
