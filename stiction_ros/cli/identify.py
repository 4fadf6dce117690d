"""``stiction identify``: friction, process and a verdict per valve from one record."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from stiction_ros.cli import choices
from stiction_ros.cli.intake import (
    add_columns,
    add_intake,
    intake_options,
    opened,
    show_loops,
    tell,
)
from stiction_ros.cli.json_output import write_json
from stiction_ros.cli.progress import bar
from stiction_ros.errors import InputError
from stiction_ros.records.parts import longest_part

if TYPE_CHECKING:
    from stiction_ros.identification import Identification
    from stiction_ros.identification.closed_loop.cause import Cause


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "identify",
        help="identify friction and process from a record",
        description="Identify the friction of every valve and the process behind it from "
        "controller output and measurement, and say which valve sticks. Of a record with gaps "
        "or of several runs the longest good part is taken.",
    )
    parser.add_argument("record", metavar="RECORD", help="CSV file, other export, or bag")
    add_columns(parser)
    add_intake(parser)
    parser.add_argument("--na", type=int, metavar="N", help="order n_a (default: by BIC)")
    parser.add_argument("--nb", type=int, metavar="N", help="order n_b (default: n_a)")
    parser.add_argument(
        "--delay", type=delay_range, default=(0, 10), metavar="LO:HI", help="samples (0:10)"
    )
    parser.add_argument(
        "--law",
        default="he",
        metavar="LAW",
        help=f"friction law of method exact: {' | '.join(choices.laws())} (default: he)",
    )
    parser.add_argument(
        "--method", default="exact", choices=choices.METHODS, help="search (default: exact)"
    )
    parser.add_argument(
        "--starts", type=int, metavar="M", help="first guesses of method nlp (default: 7)"
    )
    parser.add_argument(
        "--grid-step", type=float, metavar="S", help="step of method grid in %% (default: 0.5)"
    )
    parser.add_argument("--json", metavar="F", help="write the result as JSON; - for stdout")
    parser.add_argument("--out", metavar="DIR", help="write report.html and figures there")
    parser.set_defaults(run=run)


def delay_range(text: str) -> tuple[int, int]:
    """Return ``LO:HI`` (or one number) as a range."""
    low, _, high = text.partition(":")
    try:
        return int(low), int(high or low)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no range, write LO:HI") from None


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    if options.dry_run:
        return show_loops([Path(options.record)], intake_options(options))
    loop = opened(options)
    record, parts = longest_part(loop.parts), loop.parts
    from stiction_ros.identification import IdentificationOptions, identify

    settings = IdentificationOptions(
        method=options.method,
        output_order=options.na,
        input_order=options.nb,
        delay=options.delay,
        law=options.law,
        **method_options(options),
    )
    with bar("identifying") as show:
        found = identify(record, settings, progress=show)
    document = {"record": str(options.record)} | found.to_json()
    if options.json is not None:
        write_json(options.json, document)
    if options.json != "-":
        print(f"{loop.name}: {loop.summary}")
        _print(document, found)
    else:
        tell(loop)
    if options.out is not None:
        from stiction_ros.report.record_report import report_record

        directory = Path(options.out)
        try:
            directory.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot be made ({error.strerror})", where=options.out) from None
        page = report_record(record, found, directory, parts)
        print(f"report: {page}", file=sys.stderr)
    return 0


def method_options(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options of one method alone, refused with any other method."""
    chosen: dict[str, Any] = {}
    for key, option, method in (
        ("starts", "--starts", "nlp"),
        ("grid_step", "--grid-step", "grid"),
    ):
        value = getattr(options, key)
        if value is None:
            continue
        if options.method != method:
            raise InputError(
                f"method {options.method} has no such option",
                where=option,
                fix=f"add --method {method}",
            )
        chosen[key] = value
    return chosen


def _print(document: Mapping[str, Any], found: Identification) -> None:
    console = Console()
    table = Table(title=f"{document['record']}: {found.samples} samples", title_justify="left")
    for name in ("valve", "verdict", "f_S %", "interval", "f_D %", "interval", "moves", "band"):
        table.add_column(name)
    for valve in found.valves:
        table.add_row(
            valve.name,
            str(valve.verdict),
            f"{valve.static_friction:.3g}",
            "{:.3g} to {:.3g}".format(*valve.static_interval),
            f"{valve.dynamic_friction:.3g}",
            "{:.3g} to {:.3g}".format(*valve.dynamic_interval),
            str(valve.moves),
            f"{100 * valve.band_share:.0f} % of OP" if valve.band_share > 0.0 else "",
        )
    console.print(table)
    for output in found.outputs:
        delays = ", ".join(f"{valve} {delay}" for valve, delay in output.delay.items())
        console.print(
            f"{output.name}: delay {delays} samples, fit {output.fit_one_step:.1f} % one step, "
            f"{output.fit_free_run:.1f} % free run, noise {output.noise_std:.3g}"
        )
        if output.cause is not None:
            console.print(f"{output.name}: {_cause(output.cause)}")
    for note in found.notes:
        console.print(f"note: {note}")


def _cause(cause: Cause) -> str:
    """Return why an output oscillates, in words."""
    from stiction_ros.identification.closed_loop.cause import CauseKind

    if cause.kind is CauseKind.NONE or cause.period is None:
        return f"cause {cause.kind}. {cause.sentence}"
    return (
        f"cause {cause.kind}, period {cause.period:.3g} s, regularity {cause.regularity:.1f}, "
        f"amplitude {cause.amplitude:.3g}. {cause.sentence}"
    )
