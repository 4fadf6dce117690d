"""``stiction gain``: what would help a loop, simulated."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from stiction_ros.cli.options.intake import (
    add_columns,
    add_intake,
    intake_options,
    opened,
    show_loops,
    tell,
)
from stiction_ros.cli.output.as_json import hand_over
from stiction_ros.cli.output.progress import bar
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.loop.set_points import SetPoints

MODEL_ENDING = ".loop.yaml"


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "gain",
        help="what service, embedding or retuning would bring",
        description="Simulate what would help a loop: a serviced valve, a controller that knows "
        "the friction, another tuning, or nothing. A record is identified first and the "
        "controller of the record is the baseline; a model needs a controller of its own.",
    )
    parser.add_argument(
        "record", metavar="RECORD|MODEL", help=f"CSV file, other export, bag, or *{MODEL_ENDING}"
    )
    add_columns(parser)
    add_intake(parser)
    parser.add_argument("--valve", metavar="TAG", help="of several valves (default: widest band)")
    parser.add_argument("--set-points", metavar="F", help="schedule, for a model")
    parser.add_argument("--samples", type=int, metavar="N", help="of a run, for a model (2000)")
    parser.add_argument("--json", metavar="F", help="write the result as JSON; - for stdout")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    # Simulating takes compiled code, which other commands do not wait for.
    from stiction_ros.gain.gain import Gain

    if options.dry_run:
        return show_loops([Path(options.record)], intake_options(options))
    found: Gain = _of_model(options) if _is_model(options.record) else _of_record(options)
    hand_over(options.json, {"record": str(options.record)} | found.to_json(), lambda: show(found))
    return 0


def _is_model(source: str) -> bool:
    return source.endswith((MODEL_ENDING, ".yaml", ".yml"))


def _of_model(options: argparse.Namespace) -> Any:
    from stiction_ros.gain.model_gain import SAMPLES, gain_of_model

    model = LoopModel.load(options.record)
    schedule = None
    if options.set_points is not None:
        schedule = SetPoints.load(options.set_points, model.outputs)
    samples = SAMPLES if options.samples is None else options.samples
    if samples < 100:
        raise InputError(f"{samples} is too few", where="--samples", fix="use 100 or more")
    with bar("simulating"):
        return gain_of_model(model, schedule, samples)


def _of_record(options: argparse.Namespace) -> Any:
    from stiction_ros.gain.gain import gain_of
    from stiction_ros.identification import identify
    from stiction_ros.records.parts import longest_part

    for key in ("set_points", "samples"):
        if getattr(options, key) is not None:
            raise InputError(
                "a record brings its own", where=f"--{key.replace('_', '-')}", fix="leave it out"
            )
    loop = opened(options)
    tell(loop)
    record = longest_part(loop.parts)
    with bar("identifying") as show_share:
        identified = identify(record, progress=show_share)
    with bar("simulating"):
        return gain_of(record, identified, options.valve)


def show(found: Any) -> None:
    """Print the options as a table."""
    table = Table(title=f"{found.valve} and {found.output}", title_justify="left")
    for name in ("", "amplitude", "IAE per hour", "travel %/h", "moves/h", "reversals/h", ""):
        table.add_column(name)
    table.add_row("now", *_cells(found.now), "")
    for option in found.options:
        cells = ["–"] * 5 if option.measures is None else _cells(option.measures)
        table.add_row(option.what.value, *cells, option.note)
    console = Console()
    console.print(table)
    for note in found.notes:
        console.print(f"note: {note}")


def _cells(measures: Any) -> list[str]:
    values = (
        measures.amplitude,
        measures.iae_per_hour,
        measures.travel_per_hour,
        measures.moves_per_hour,
        measures.reversals_per_hour,
    )
    return ["–" if value is None else f"{value:.3g}" for value in values]
