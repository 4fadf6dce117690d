"""``stiction calibrate``: probabilities of friction and of effects, fitted to known loops."""

import argparse
import dataclasses
import functools
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table

from stiction_ros.errors import InputError, storing
from stiction_studies.judged_log import logged_rows, start_log
from stiction_studies.seeds import add_jobs, run_each, seed_range

if TYPE_CHECKING:
    from stiction_ros.effects import FloatArray
    from stiction_studies.calibration.fitting import Judged

SEEDS = {
    "field": ((0, 399), (27300, 27649)),
    **dict.fromkeys(("plain", "quiet", "cascade", "waves"), ((0, 399),)),
    "pair": ((0, 159),),
}
"""Of each world, when none are given: a loop of a pair takes as long as ten others."""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "calibrate",
        description="Identify simulated loops, fit the probability to their figures, and hold "
        "each loop against what is fitted to others. With --gap: fit the probability of effects.",
    )
    parser.add_argument(
        "--gap",
        type=Path,
        metavar="LOG",
        help="log of ``stiction bench world``: fit the probability of what ``stiction gap`` names",
    )
    parser.add_argument(
        "--worlds",
        nargs="+",
        choices=tuple(SEEDS),
        default=tuple(SEEDS),
        metavar="NAME",
        help="worlds of simulated loops (all)",
    )
    parser.add_argument(
        "--seeds",
        type=seed_range,
        metavar="A:B",
        help="seeds from A to B of each world (those that the shipped trees are fitted to)",
    )
    parser.add_argument(
        "--log",
        type=Path,
        metavar="F",
        help="file that keeps the figures, and from which a run goes on",
    )
    parser.add_argument(
        "--out", type=Path, metavar="F.json", help="write the fitted trees to this file"
    )
    parser.add_argument(
        "--ablate", action="store_true", help="fit again without each figure in turn"
    )
    add_jobs(parser)
    parser.set_defaults(run=run)


def judged(log: Path | None, task: tuple[str, int]) -> "Judged | None":
    """Return the figures of one loop; None where its truth or the record is not clear."""
    from stiction_ros.identification import identify
    from stiction_ros.records.parts import longest_part
    from stiction_studies.calibration.fitting import Judged
    from stiction_studies.calibration.loops import WORLDS

    world, seed = task
    loop = WORLDS[world](seed)
    row = None
    if loop.friction is not None:
        try:
            *_, valve = identify(longest_part([loop.record])).valves
        except InputError:
            return None
        if valve.figures is not None:
            row = Judged(world, seed, loop.friction, valve.figures)
    if log is not None and row is not None:
        with storing(log), log.open("a", encoding="utf-8") as out:
            out.write(json.dumps({"full": True} | dataclasses.asdict(row)) + "\n")
    return row


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    from stiction_studies.calibration.fitting import fitted

    if options.gap is not None:
        return _run_gap(options)
    known: list[Judged] = []
    if options.log is not None:
        known = logged_rows(options.log, True, _row_of) if options.log.exists() else []
        if not known:
            start_log(options.log)
    there = {(row.world, row.seed) for row in known}
    seeds = {
        world: SEEDS[world] if options.seeds is None else (options.seeds,)
        for world in options.worlds
    }
    tasks = [(w, seed) for w, parts in seeds.items() for a, b in parts for seed in range(a, b + 1)]
    due = [task for task in tasks if task not in there]
    work = functools.partial(judged, options.log)
    found = [row for row in run_each(work, due, options.jobs or 1, "calibrate") if row is not None]
    rows = [row for row in (*known, *found) if (row.world, row.seed) in set(tasks)]
    show(rows, options.ablate)
    if options.out is not None:
        _write(options.out, {"fitted_to": seeds, "loops": len(rows)} | fitted(rows)._asdict())
    return 0


def _run_gap(options: argparse.Namespace) -> int:
    from stiction_studies.blind.scores.world_scores import WorldScore
    from stiction_studies.calibration.fitting import FOLDS
    from stiction_studies.calibration.gap_fitting import fitted, held

    scores = logged_rows(options.gap, False, WorldScore.from_mapping)
    Console().print(reliability(*held(scores, FOLDS), "members", "there"))
    if options.out is not None:
        seeds: dict[str, list[int]] = {}
        for row in scores:
            seeds.setdefault(f"{row.family}-{row.given}", []).append(row.seed)
        told = {world: [min(own), max(own)] for world, own in seeds.items()}
        _write(options.out, {"fitted_to": told, "loops": len(scores)} | fitted(scores)._asdict())
    return 0


def _write(path: Path, told: dict[str, Any]) -> None:
    with storing(path):
        path.write_text(json.dumps(told, separators=(",", ":")) + "\n", "utf-8")


def show(rows: "list[Judged]", ablate: bool) -> None:
    """Print how loops are told by trees fitted to others: of all worlds, and of other worlds."""
    from stiction_ros.identification.judgement import definitions
    from stiction_studies.calibration.fitting import by_folds, counts, fitted, loss, probabilities

    console = Console()
    folds = by_folds(rows)
    for world in sorted({row.world for row in rows}):
        own = [i for i, row in enumerate(rows) if row.world == world]
        rest = [row for row in rows if row.world != world]
        parts = {"other loops": folds[own]}
        if rest:
            parts["other worlds"] = probabilities(fitted(rest), [rows[i] for i in own])
        for name, told in parts.items():
            table = Table(f"{world}, told by {name}", "")
            for key, value in counts(told, [rows[i] for i in own]).items():
                table.add_row(key, f"{value:.3f}")
            console.print(table)
    truth = np.array([row.friction for row in rows])
    console.print(reliability(folds, truth, "loops", "with friction"))
    if ablate:
        table = Table("without", "loss, nats a loop", "more")
        whole = loss(folds, rows)
        for name in definitions():
            other = loss(by_folds(rows, name), rows)
            table.add_row(name, f"{other:.4f}", f"{other - whole:+.4f}")
        console.print(table)


def reliability(told: "FloatArray", true: "FloatArray", what: str, is_true: str) -> Table:
    """Return how often what is told with a probability is true, in tenths of it."""
    table = Table("probability", what, is_true)
    tenths = np.minimum(10.0 * told, 9.0).astype(int)
    for k in np.unique(tenths):
        inside = tenths == k
        table.add_row(f"{told[inside].mean():.2f}", f"{inside.sum()}", f"{true[inside].mean():.2f}")
    return table


def _row_of(values: Any) -> "Judged":
    from stiction_ros.identification.judgement import Figures
    from stiction_studies.calibration.fitting import Judged

    return Judged(**{**values, "figures": Figures(**values["figures"])})
