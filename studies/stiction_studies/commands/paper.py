"""``stiction paper``: the paper's figures and tables, printed numbers beside ours."""

import argparse
import functools
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.progress import bar
from stiction_ros.errors import InputError, storing
from stiction_studies.commands import choices
from stiction_studies.seeds import run_seeds, seed_range


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "paper",
        description="Draw the paper's figures and print its tables, the printed number beside "
        "ours, as one page. With --success: count how often a method finds the friction.",
    )
    parser.add_argument(
        "--figure",
        type=int,
        action="append",
        choices=choices.FIGURES,
        help="one figure; may be repeated",
    )
    parser.add_argument(
        "--table", action="append", choices=choices.TABLES, help="one table; may be repeated"
    )
    parser.add_argument("--all", action="store_true", help="every figure and every table")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the noise (1)")
    parser.add_argument("--out", required=True, metavar="DIR", help="page, figures, paper.json")
    group = parser.add_argument_group("counting, in place of figures and tables")
    group.add_argument(
        "--success",
        type=seed_range,
        metavar="A:B",
        help="count over seeds; runs are added to DIR/paper_success.json",
    )
    group.add_argument("--example", type=int, choices=(1, 2), help="count one example (both)")
    group.add_argument(
        "--method",
        action="append",
        choices=choices.COUNTED,
        help=f"count these methods; repeat (all: {', '.join(choices.COUNTED)})",
    )
    group.add_argument("--jobs", type=int, default=1, metavar="N", help="processes (1)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    directory = Path(options.out)
    wanted = bool(options.figure or options.table or options.all)
    if options.success is None:
        for key in ("example", "method"):
            if getattr(options, key) is not None:
                raise InputError("belongs to --success", where=f"--{key}", fix="leave it out")
        if not wanted:
            raise InputError("says nothing to draw", where="paper", fix="use --all, or --figure 2")
    elif wanted:
        raise InputError("counts alone", where="--success", fix="leave figures and tables out")
    with storing(options.out, what="made"):
        directory.mkdir(parents=True, exist_ok=True)
    return _count(options, directory) if options.success else _draw(options, directory)


def _draw(options: argparse.Namespace, directory: Path) -> int:
    from stiction_studies.paper.exhibits import chosen, draw

    names = chosen(options.figure or (), options.table or (), options.all)
    with bar("paper") as show:
        page, exhibits = draw(names, options.seed, directory, show)
    console = Console()
    for exhibit in exhibits:
        table = Table(title=exhibit.title, title_justify="left")
        for name in ("", "printed", "ours", "remark"):
            table.add_column(name)
        for row in exhibit.rows:
            table.add_row(row.what, row.printed, row.ours, row.remark)
        console.print(table)
    console.print(f"{page}")
    return 0


def _count(options: argparse.Namespace, directory: Path) -> int:
    from stiction_studies.paper.success import FILE, Success, run_trial

    path = directory / FILE
    count = Success.load(path) if path.exists() else Success()
    examples = (1, 2) if options.example is None else (options.example,)
    for number in examples:
        for method in options.method or choices.COUNTED:
            work = functools.partial(run_trial, number, method)
            title = f"example {number}, {method}"
            trials = run_seeds(work, options.success, options.jobs, title)
            first, last = min(options.success), max(options.success)
            command = (
                f"stiction paper --success {first}:{last} --example {number} --method {method}"
            )
            count = count.with_trials(trials, command)
            count.save(path)
    table = Table(title=f"{path}", title_justify="left")
    for name in ("example", "method", "seeds", "right", "delay right", "seconds"):
        table.add_column(name)
    for rate in count.rates():
        table.add_row(
            str(rate.example),
            rate.method,
            "{}:{}".format(*rate.seeds),
            f"{rate.right} of {rate.total}",
            f"{rate.delay_right}",
            f"{rate.seconds:.2f}",
        )
    Console().print(table)
    return 0
