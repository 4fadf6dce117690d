"""``stiction gap``: what a simulation misses, from records of the loop."""

import argparse
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared import intake_options as intake
from stiction_ros.cli.shared import searches
from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.progress import bar
from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError, storing
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record
from stiction_ros.records.parts import longest_part

if TYPE_CHECKING:
    from stiction_ros.discrepancy import Discrepancy

EXIT_CODES = {"named": 0, "none": 0, "ambiguous": 3, "unknown": 4, "untestable": 5}


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "gap",
        description="Compare a loop model with records of its loop, name the physical effect that "
        "it lacks, add it and measure the gap again. Exit codes: 0 named or none, 3 ambiguous, "
        "4 unknown, 5 untestable.",
    )
    parser.add_argument(
        "inputs",
        nargs="+",
        metavar="FILE",
        help="the loop model, then records (CSV files or bags); records alone with --fit-linear",
    )
    parser.add_argument(
        "--after",
        metavar="FILE",
        help="a record of the experiment that the answer named; both together decide",
    )
    intake.add_columns(parser)
    intake.add_intake(parser)
    parser.add_argument(
        "--fit-linear",
        action="store_true",
        help="fit a linear model to the longest record, where there is no model yet",
    )
    searches.add_delay(parser, "delays that --fit-linear tries")
    parser.add_argument(
        "--quick",
        action="store_true",
        help="take stored thresholds and intervals by likelihood, without a bootstrap",
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the bootstraps (0)")
    parser.add_argument("--json", metavar="F", help="write the result as JSON; - for stdout")
    parser.add_argument(
        "--out", metavar="DIR", help="write report.html and model_after.loop.yaml there"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    options.inputs += [options.after] if options.after else []
    model, records = _inputs(options)
    from stiction_ros.discrepancy import GapOptions, find_discrepancy

    settings = GapOptions(
        quick=options.quick, seed=options.seed, process_fitted=bool(options.fit_linear)
    )
    with bar("comparing") as show:
        found = find_discrepancy(model, records, settings, progress=show)
    if options.out is not None:  # first: who reads what is printed may stop doing so
        _write(found, Path(options.out))
    given = ["stiction", "gap", *["--fit-linear"] * options.fit_linear, *options.inputs]
    hand_over(options.json, found.to_dict(), lambda: _print(found, shlex.join(given)))
    return EXIT_CODES[found.verdict]


def _inputs(options: argparse.Namespace) -> tuple[LoopModel, list[Record]]:
    if options.fit_linear:
        for path in filter(intake.is_model, options.inputs):
            raise InputError(
                "is a loop model", where=path, fix="leave it out, --fit-linear makes one"
            )
        records = [_record(path, options) for path in options.inputs]
        from stiction_ros.discrepancy.process.first_model import first_model

        return first_model(records, options.delay), records
    if len(options.inputs) < 2:
        raise InputError(
            "no record",
            where="gap",
            fix="write stiction gap MODEL RECORD, or --fit-linear RECORD without a model",
        )
    if not intake.is_model(options.inputs[0]):
        raise InputError(
            "is no loop model",
            where=options.inputs[0],
            fix="name the model first, a .yaml file, then its records",
        )
    model = LoopModel.load(find_config(options.inputs[0]))
    return model, [_record(path, options) for path in options.inputs[1:]]


def _record(path: str, options: argparse.Namespace) -> Record:
    loop = intake.opened(argparse.Namespace(**{**vars(options), "record": path}))
    return longest_part(loop.parts)


def _write(found: "Discrepancy", directory: Path) -> None:
    from stiction_ros.report.gap_page import report_gap

    with storing(directory, what="made"):
        directory.mkdir(parents=True, exist_ok=True)
    found.model_after.save(directory / "model_after.loop.yaml")
    print(f"report: {report_gap(found, directory)}", file=sys.stderr)


def _print(found: "Discrepancy", command: str) -> None:
    """Print the answer; to the ``command`` that was given a further record may be added."""
    from stiction_ros.discrepancy import GapVerdict
    from stiction_ros.report.gap_words import called, lines_of, one_of, plain, titled

    console = Console()
    names = ", ".join(record.name for record in found.runs.records)
    console.print(f"{names}: {found.verdict}", markup=False)
    for effect in found.effects:
        name = titled(effect, called(effect.place, effect.effect))
        console.print(f"{name}, ΔBIC {effect.delta_bic:.0f}", markup=False)
        for line in lines_of(effect):
            console.print(f"  {plain(line)}", markup=False)
    if not found.effects and found.alternatives:
        console.print(f"one of: {one_of(found.alternatives, found.probabilities)}", markup=False)
    for change in found.process_changes:
        console.print(f"process to {change.output}: {change.sentence}", markup=False)
    console.print(_gaps(found))
    for sentence in found.where:
        console.print(f"where: {plain(sentence)}", markup=False)
    if found.experiment:
        console.print(f"to learn more: {found.experiment}", markup=False)
        if found.alternatives:
            console.print(f"then with both records: {command} --after NEXT_RECORD", markup=False)
    if found.untestable:
        listed = ", ".join(called(t.place, t.effect) for t in found.untestable)
        console.print(f"not testable here: {listed}", markup=False)
    if found.verdict is not GapVerdict.NAMED:  # a page lists them, whatever the verdict
        reasons: dict[str, set[str]] = {}
        for entry in found.not_considered:
            reasons.setdefault(entry.reason, set()).add(entry.name)
        for reason, left in reasons.items():
            console.print(f"not considered: {', '.join(sorted(left))}: {reason}", markup=False)
    for note in found.notes:
        console.print(f"note: {note}", markup=False)


def _gaps(found: "Discrepancy") -> Table:
    title = f"gap on held-out samples; closed {100.0 * found.closed:.0f} % of its excess"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for head in ("output", "free run", "after", "noise", "one step", "after", "noise"):
        table.add_column(head, justify="left" if head == "output" else "right")
    for before, after in zip(found.before, found.after, strict=True):
        free = before.free_run_rmse, after.free_run_rmse, after.floor_free_run
        ahead = before.one_step_rmse, after.one_step_rmse, after.floor_one_step
        table.add_row(before.name, *(f"{value:.4g}" for value in (*free, *ahead)))
    return table
