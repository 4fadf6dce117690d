"""``stiction bench``: figures of speed, always as ratios of one run on one machine."""

import argparse
import dataclasses
import os
import platform
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.progress import Bar, bar
from stiction_ros.cli.shared.searches import add_search_options
from stiction_ros.errors import InputError
from stiction_studies.benches import against
from stiction_studies.benches.accuracy import field as bench_field
from stiction_studies.benches.accuracy import gap as bench_gap
from stiction_studies.benches.accuracy import plant as bench_plant
from stiction_studies.benches.accuracy import world as bench_world
from stiction_studies.benches.speed.row import Row
from stiction_studies.commands import choices

OPTIONS: dict[str, tuple[str, ...]] = {
    "control": ("seed", "quick"),
    "identification": (
        *("repeat", "seed", "longest", "quick", "friction_limit", "starts", "grid_step"),
    ),
    "gap": ("family", "first", "loops", "full", "jobs", "log", "resume", "write"),
    "world": ("family", "given", "first", "loops", "full", "jobs", "log", "resume", "write"),
    "field": ("seeds", "method", "jobs", "oracle"),
    "gain": ("seeds", "jobs"),
    "plant": ("truth", "survey"),
    "exports": ("seeds", "jobs"),
    "own": ("seeds", "jobs"),
    "valve-test": ("seeds", "jobs"),
}
COLUMNS = ("case", "subject", "ms", "p99", "baseline", "ms", "baseline / subject")


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "bench",
        description="Measure speed against a baseline in the same run (graph, identification, "
        "control, record), or count how often the discrepancy workflow is right (gap; world: in "
        "loops that share nothing with it), how often identification is (field), whether "
        "what gain promises comes about (gain), how tests in manual end (valve-test), what the "
        "list of a survey is worth (plant), whether exports are read as they were written "
        "(exports), and what each controller makes of plants that it was not tuned for (own).",
    )
    parser.add_argument(
        "name",
        nargs="?",
        default="graph",
        choices=(*BENCHMARKS, "gap", *COUNTS),
        help="what to measure (graph)",
    )
    group = parser.add_argument_group("identification; --seed and --quick also for control")
    group.add_argument(
        "--repeat",
        type=int,
        metavar="N",
        help="runs of the exact search; nlp and grid run once (3)",
    )
    group.add_argument("--seed", type=int, metavar="N", help="seed of the simulated records (7)")
    group.add_argument(
        "--longest", type=int, metavar="N", help="longest record of growing N (100000)"
    )
    group.add_argument(
        "--quick",
        action="store_true",
        default=None,
        help="fewer delays, one start, coarser grids, records up to 10000 samples",
    )
    add_search_options(group)
    bench_gap.add_options(parser)
    bench_world.add_options(parser)
    bench_field.add_options(parser)
    bench_plant.add_options(parser)
    turns = parser.add_argument_group("another version, side by side")
    turns.add_argument(
        "--against",
        type=Path,
        metavar="DIR",
        help="run both this tree and the worktree DIR, which has its own .venv, in turns; the "
        "other is the baseline",
    )
    turns.add_argument("--turns", type=int, metavar="N", help="runs of each of the two (3)")
    parser.add_argument("--json", metavar="F", help="write the rows as JSON; - for stdout")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    name = _world_for_physics(options)
    own = OPTIONS.get(name, ())
    for key in {key for keys in OPTIONS.values() for key in keys}.difference(own):
        if getattr(options, key) is not None:
            raise InputError(
                f"benchmark {name} has no such option",
                where=f"--{key}",
                fix="leave it out, or measure another",
            )
    if options.against is not None:
        return _in_turns(name, options)
    if options.turns is not None:
        raise InputError(
            "there is nothing to take turns with", where="--turns", fix="use --against"
        )
    if name == "gap":
        return bench_gap.run(options)
    if name in COUNTS:
        return COUNTS[name](options, machine())
    with bar(f"bench {name}") as show:
        rows = BENCHMARKS[name](options, show)
    _hand_over(name, options, rows)
    return 0


def _in_turns(name: str, options: argparse.Namespace) -> int:
    turns = against.TURNS if options.turns is None else options.turns
    with bar(f"bench {name}") as show:
        ran = against.alternate(against.repeated(options.words), options.against, turns, show)
    _hand_over(name, options, ran.rows())
    for said in ran.alone():
        print(said, file=sys.stderr)
    return 0


def _hand_over(name: str, options: argparse.Namespace, rows: Sequence[Row]) -> None:
    """Write the rows as JSON where that is asked for, and print them."""
    told = [dataclasses.asdict(row) for row in rows]
    document = {"name": name, "machine": machine(), "rows": told}
    hand_over(options.json, document, lambda: _print(rows))


def _world_for_physics(options: argparse.Namespace) -> str:
    """Return the benchmark's name; friction by mechanics is of the world of others."""
    families = options.family or []
    if options.name != "gap" or not {choices.PHYSICS, choices.PROCESS} & set(families):
        return str(options.name)
    if len(set(families)) > 1:
        raise InputError(
            "physics and process come from another world than the other families",
            where="--family",
            fix="run it by itself",
        )
    return "world"


def machine() -> str:
    """Return where the figures come from, in one line."""
    threads = os.environ.get("OMP_NUM_THREADS", "all")
    return (
        f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores, "
        f"Python {platform.python_version()}, OMP_NUM_THREADS={threads}"
    )


def _graph(options: argparse.Namespace, show: Bar) -> list[Row]:
    from stiction_studies.benches.speed import graph as bench_graph

    return bench_graph.graph(show)


def _record(options: argparse.Namespace, show: Bar) -> list[Row]:
    from stiction_studies.benches.speed import record as bench_record

    return bench_record.record(show)


def _identification(options: argparse.Namespace, show: Bar) -> list[Row]:
    from stiction_studies.benches.speed import identification as bench_identification

    plan = bench_identification.QUICK if options.quick else bench_identification.FULL
    chosen = {
        key: value
        for key in OPTIONS["identification"]
        if key != "quick" and (value := getattr(options, key)) is not None
    }
    return bench_identification.identification(dataclasses.replace(plan, **chosen), show)


def _control(options: argparse.Namespace, show: Bar) -> list[Row]:
    from stiction_studies.benches.speed import control as bench_control

    plan = bench_control.QUICK if options.quick else bench_control.FULL
    if options.seed is not None:
        plan = dataclasses.replace(plan, seed=options.seed)
    return bench_control.control(plan, show)


def _print(rows: Sequence[Row]) -> None:
    table = Table()
    for name in COLUMNS:
        table.add_column(name)
    for row in rows:
        table.add_row(
            row.case,
            row.subject,
            _number(row.subject_ms),
            _number(row.p99_ms),
            row.baseline,
            _number(row.baseline_ms),
            _number(row.ratio),
        )
    console = Console()
    console.print(table)
    for row in rows:
        console.print(f"{row.case}, {row.subject} against {row.baseline}: {row.note}")


def _number(value: float) -> str:
    return f"{value:.3f}" if value < 100.0 else f"{value:.0f}"


def _gain(options: argparse.Namespace, machine: str) -> int:
    from stiction_studies.benches.accuracy import gain as bench_gain

    return bench_gain.run(options, machine)


def _exports(options: argparse.Namespace, machine: str) -> int:
    from stiction_studies.benches.accuracy import exports as bench_exports

    return bench_exports.run(options, machine)


def _own(options: argparse.Namespace, machine: str) -> int:
    from stiction_studies.benches.accuracy import own_plant as bench_own_plant

    return bench_own_plant.run(options, machine)


def _valve_test(options: argparse.Namespace, machine: str) -> int:
    from stiction_studies.benches.accuracy import valve_test as bench_valve_test

    return bench_valve_test.run(options, machine)


BENCHMARKS: dict[str, Callable[[argparse.Namespace, Bar], list[Row]]] = {
    "graph": _graph,
    "identification": _identification,
    "record": _record,
    "control": _control,
}

COUNTS: dict[str, Callable[[argparse.Namespace, str], int]] = {
    "field": bench_field.run,
    "gain": _gain,
    "plant": bench_plant.run,
    "exports": _exports,
    "own": _own,
    "valve-test": _valve_test,
    "world": bench_world.run,
}
