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
from stiction_ros.cli.json_output import write_json
from stiction_ros.cli.progress import bar
from stiction_ros.errors import InputError
from stiction_ros.records.csv_file import CsvColumns
from stiction_ros.records.open_record import open_parts
from stiction_ros.records.parts import longest_part
from stiction_ros.records.record import Record

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
    parser.add_argument("record", metavar="RECORD", help="CSV file or bag")
    add_columns(parser)
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


def add_columns(parser: argparse.ArgumentParser) -> None:
    """Add the options that name the columns of a CSV file, or the loop in a bag."""
    group = parser.add_argument_group(
        "columns of a CSV file (default: t, OP, PV[, SP][, STEM])",
        "A file that stiction wrote needs none of these: its TAG.OP, TAG.PV … are recognised.",
    )
    for option, text in (
        ("op", "controller output of a valve"),
        ("pv", "process variable"),
        ("sp", "set-point of a process variable"),
        ("stem", "true stem position of a valve"),
    ):
        group.add_argument(
            f"--{option}", action="append", type=_pair, default=[], metavar="TAG=COL", help=text
        )
    group.add_argument("--time", metavar="COL", help="seconds or ISO time stamps")
    parser.add_argument(
        "--namespace", metavar="NS", help="of the loop's topics, for a bag that holds several loops"
    )


def columns(options: argparse.Namespace) -> CsvColumns:
    """Return the chosen columns."""
    chosen: dict[str, Any] = {}
    for key in ("op", "pv", "sp", "stem"):
        if getattr(options, key):
            chosen[key] = dict(getattr(options, key))
    if options.time is not None:
        chosen["time"] = options.time
    return CsvColumns(**chosen)


def opened(options: argparse.Namespace) -> tuple[Record, tuple[Record, ...]]:
    """Return the longest good part of the record that the command line names, and all parts."""
    parts = open_parts(options.record, columns(options), namespace=options.namespace)
    return longest_part(parts), parts


def delay_range(text: str) -> tuple[int, int]:
    """Return ``LO:HI`` (or one number) as a range."""
    low, _, high = text.partition(":")
    try:
        return int(low), int(high or low)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no range, write LO:HI") from None


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    record, parts = opened(options)
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
        _print(document, found)
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


def _pair(text: str) -> tuple[str, str]:
    tag, sign, column = text.partition("=")
    if not sign or not tag or not column:
        raise argparse.ArgumentTypeError(f"{text!r} is not TAG=COL")
    return tag, column
