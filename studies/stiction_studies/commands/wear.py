"""``stiction study-wear``: IAE against moves of the stem, over controllers and prices."""

from __future__ import annotations

import argparse
import functools
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.scenarios import find
from stiction_ros.errors import InputError
from stiction_studies.seeds import add_jobs, run_seeds, seed_range

if TYPE_CHECKING:
    from stiction_ros.online.session import Scenario
    from stiction_studies.examples.wear_study import WearScore

FACTORS = (0.1, 0.3, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0)
LIMIT = 1.10  # IAE over that without friction that is asked of the scenario's own worth
WIDTH = 110  # characters that the table needs


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "study-wear",
        help="IAE against moves of the stem, over controllers and the worth of a move",
        description="Run a scenario's plant, without ROS, under the unaware controller, the "
        "paper's inversion and embedding, the exact embedding at several worths of a move, and "
        "without friction; all know the true friction. Exit code 1 when the exact embedding of "
        f"the scenario has an IAE above {LIMIT:g} of that without friction, or travels or moves "
        "more than the unaware controller.",
    )
    parser.add_argument("scenario", metavar="SCENARIO", help="tank, siso, or a file")
    parser.add_argument(
        "--seeds", type=seed_range, default=(101, 110), metavar="A:B", help="inclusive (101:110)"
    )
    factors = ",".join(f"{factor:g}" for factor in FACTORS)
    parser.add_argument(
        "--worths", default=factors, metavar="F,F", help=f"factors of the scenario's ({factors})"
    )
    parser.add_argument("--no-printed", action="store_true", help="leave SI and SE printed out")
    parser.add_argument(
        "--ablation", action="store_true", help="the exact one without each of its parts instead"
    )
    parser.add_argument(
        "--floor",
        action="store_true",
        help="tank: also the least IAE of C that so many moves of valve 1 can buy at all",
    )
    add_jobs(parser)
    parser.add_argument("--json", metavar="F", help="write the means; - for stdout")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    factors = _factors(options.worths)
    path = find(options.scenario)
    from stiction_ros.online.session import Scenario
    from stiction_studies.examples.wear_study import (
        EXACT,
        FREE,
        PRINTED,
        UNAWARE,
        mean_score,
        priced,
        run_candidates,
        without,
    )

    scenario = Scenario.load(path)
    _require(scenario)
    varied = without(scenario) if options.ablation else priced(scenario, factors)
    printed = () if options.no_printed or options.ablation else PRINTED
    candidates = (FREE, UNAWARE, EXACT, *printed, *varied)
    work = functools.partial(run_candidates, scenario, candidates)
    runs = run_seeds(work, options.seeds, options.jobs, scenario.name)
    means = [mean_score([run[i] for run in runs]) for i in range(len(candidates))]
    names = [candidate.name for candidate in candidates]
    hand_over(
        options.json,
        [_row(n, m, means[0]) for n, m in zip(names, means, strict=True)],
        lambda: _print(scenario, options.seeds, names, means),
    )
    if options.floor:
        _print_floor(scenario, options.seeds, means[0])
    free, unaware, exact = means[:3]
    spared = exact.travel <= unaware.travel and exact.moves <= unaware.moves
    return 0 if spared and bool(np.all(exact.iae <= LIMIT * free.iae)) else 1


def _print_floor(scenario: Scenario, seeds: tuple[int, int], free: WearScore) -> None:
    from stiction_studies.examples.wear_floor import least_iae

    (jump,) = (
        effect.jump for effect in scenario.plant.valves[0].effects if hasattr(effect, "jump")
    )
    floors = [least_iae(scenario, seed, jump) for seed in range(seeds[0], seeds[1] + 1)]
    most = max(map(len, floors))
    padded = np.array([np.pad(floor, (0, most - len(floor)), mode="edge") for floor in floors])
    table = Table(title=f"least IAE of {scenario.process.outputs[0]}", title_justify="left")
    table.add_column("moves", justify="right")
    table.add_column("IAE / no friction", justify="right")
    for moves, value in enumerate(padded.mean(axis=0) / free.iae[0]):
        table.add_row(f"{moves}", f"{value:.3f}")
    Console().print(table)


def _factors(text: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = [-1.0]
    if not all(0.0 < factor < 1e6 for factor in found):
        raise InputError(f"{text!r} are no positive numbers", where="--worths", fix="write 0.5,1,2")
    return sorted(found)


def _require(scenario: Scenario) -> None:
    if not any(valve.effects for valve in scenario.plant.valves):
        raise InputError("has no sticky valve", where=scenario.name, fix="give one law: he")


def _row(name: str, score: WearScore, free: WearScore) -> dict[str, Any]:
    return {
        "controller": name,
        "iae": score.iae.tolist(),
        "iae_ratio": (score.iae / free.iae).tolist(),
        "offset": score.offset.tolist(),
        "travel": float(score.travel),
        "moves": float(score.moves),
        "reversals": float(score.reversals),
        "op_step": score.op_step,
    }


def _print(
    scenario: Scenario, seeds: tuple[int, int], names: list[str], means: list[WearScore]
) -> None:
    title = (
        f"{scenario.name}, seeds {seeds[0]} to {seeds[1]}, {', '.join(scenario.process.outputs)}"
    )
    table = Table(title=title, title_justify="left")
    table.add_column("", no_wrap=True)
    for head in ("IAE / no friction", "offset", "travel %", "moves", "turns", "OP step %"):
        table.add_column(head, justify="right")
    for name, score in zip(names, means, strict=True):
        row = _row(name, score, means[0])
        table.add_row(
            name,
            " ".join(f"{value:.3f}" for value in row["iae_ratio"]),
            " ".join(f"{value:.4f}" for value in row["offset"]),
            f"{score.travel:.0f}",
            f"{score.moves:.1f}",
            f"{score.reversals:.1f}",
            f"{score.op_step:.1f}",
        )
    console = Console()
    console.width = max(console.width, WIDTH)
    console.print(table)
