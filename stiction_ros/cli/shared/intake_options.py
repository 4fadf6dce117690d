"""The options by which commands read records, whatever they are kept in."""

import argparse
import csv
import sys
from collections.abc import Sequence
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.intake import CsvColumns, IntakeOptions, Loop, loops, one_loop
from stiction_ros.intake.intake import OTHERS, is_bag, strange_files
from stiction_ros.intake.intake_options import OpUnit, TimeUnit
from stiction_ros.intake.sheets.stamps import DateOrder
from stiction_ros.texts import plural


def add_columns(parser: argparse.ArgumentParser) -> None:
    """Add the options that name the columns of a file of one loop, or the loop in a bag."""
    group = parser.add_argument_group(
        "columns of a file of one loop (default: t, OP, PV[, SP][, STEM][, MODE])",
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
    group.add_argument("--time", metavar="COL", help="column of the times: seconds or dates")
    parser.add_argument(
        "--namespace",
        metavar="NS",
        help="namespace of the topics of the loop, where a bag holds several loops",
    )


def add_record(
    parser: argparse.ArgumentParser,
    text: str = "CSV file, other export, or bag",
    metavar: str = "RECORD",
) -> None:
    """Add the one record that a command takes, and the options by which it is read."""
    parser.add_argument("record", metavar=metavar, help=text)
    add_columns(parser)
    add_intake(parser)


def add_intake(parser: argparse.ArgumentParser, *, many: bool = False) -> None:
    """Add the options of exports to a command that takes one loop, or ``many``."""
    group = parser.add_argument_group("exports")
    group.add_argument(
        "--tags",
        metavar="F",
        help="table with a head loop,pv,sp,op,mode: the tags of each loop; a column file "
        "names the file of a loop",
    )
    if not many:
        group.add_argument("--loop", metavar="NAME", help="the loop, where a file holds several")
    group.add_argument(
        "--op-unit",
        choices=[unit.value for unit in OpUnit],
        metavar="UNIT",
        help=f"unit of OP: {', '.join(OpUnit)} (default: the unit in the export, else %%)",
    )
    group.add_argument(
        "--time-unit",
        choices=[unit.value for unit in TimeUnit],
        metavar="UNIT",
        help=f"unit of times that are numbers: {', '.join(TimeUnit)}",
    )
    group.add_argument(
        "--dates",
        choices=[order.value for order in DateOrder],
        help="whether the day or the month is first in dates",
    )
    group.add_argument(
        "--sample-time",
        type=float,
        metavar="S",
        help="seconds between samples, for signals that are stored on change and for rows "
        "without a time",
    )
    group.add_argument(
        "--long",
        type=_three,
        metavar="TAG,TIME,VALUE",
        help="columns of a table with one value in each row, where they are not found",
    )
    group.add_argument(
        "--auto", action="append", metavar="WORD", help="word that MODE shows in automatic"
    )
    group.add_argument("--strict", action="store_true", help="refuse a file that needs repairs")
    group.add_argument(
        "--dry-run",
        action="store_true",
        help="show what would be read and from which columns, then stop",
    )


def columns(options: argparse.Namespace) -> CsvColumns:
    """Return the chosen columns."""
    op, pv, sp, stem = (dict(getattr(options, key)) or None for key in ("op", "pv", "sp", "stem"))
    return CsvColumns(op, pv, sp, stem, options.time)


def intake_options(options: argparse.Namespace) -> IntakeOptions:
    """Return how the command line wants exports to be read."""
    step = options.sample_time
    if step is not None and not 0.0 < step < 1e9:
        raise InputError(f"{step:g} s is no sample time", where="--sample-time")
    return IntakeOptions(
        columns=columns(options),
        namespace=options.namespace,
        tags=None if options.tags is None else Path(options.tags),
        strict=options.strict,
        op_unit=None if options.op_unit is None else OpUnit(options.op_unit),
        time_unit=None if options.time_unit is None else TimeUnit(options.time_unit),
        dates=None if options.dates is None else DateOrder(options.dates),
        sample_time=step,
        long=options.long,
        automatic=None if options.auto is None else tuple(options.auto),
    )


def is_model(source: str) -> bool:
    """Tell by its name whether a file is a loop model and no record."""
    return source.endswith((".yaml", ".yml"))


def opened(options: argparse.Namespace) -> Loop:
    """Return the loop of the record that the command line names; InputError if none is read."""
    path = Path(options.record)
    if is_bag(path):
        if columns(options) != CsvColumns():
            raise InputError(
                "is a bag, which has no columns",
                where=str(path),
                fix="leave --op, --pv, --sp, --stem and --time out",
            )
    elif options.namespace is not None:
        raise InputError("is for bags", where="--namespace", fix="leave it out")
    return one_loop(path, intake_options(options), options.loop)


def dry_run(options: argparse.Namespace) -> int:
    """Print what would be read from each record of a command; 1 when no loop can be read."""
    one = (getattr(options, name, None) for name in ("record", "before", "after"))
    given = [*filter(None, one), *getattr(options, "inputs", ()), *getattr(options, "paths", ())]
    paths = [Path(source) for source in given if not is_model(source)]
    how = intake_options(options)
    readable = known = 0
    for loop in loops(paths, how):
        known += 1
        readable += loop.problem is None
        files = ", ".join(file.name for file in loop.files)
        said = loop.summary if loop.problem is None else f"not read: {loop.problem}"
        print(f"{loop.name} ({files}): {said}")
        for line in loop.signals:
            print(f"  {line}")
        for note in loop.notes:
            print(f"  note: {note}")
    print(f"{plural(known, 'loop')}, {readable} can be read" if known else "no file of a loop")
    if len(paths) > 1 or any(path.is_dir() for path in paths):
        tell_strangers(options.tags, "export", strange_files(paths, how))
    return 0 if readable else 1


def tell_strangers(file: str | Path | None, what: str, names: Sequence[str]) -> None:
    """Print to standard error which ``names`` of a file are not there, as they may be misspelt."""
    if names:
        more = " and others" if len(names) > OTHERS else ""
        print(f"{file}: no {what} is called {', '.join(names[:OTHERS])}{more}", file=sys.stderr)


def tell(loop: Loop) -> None:
    """Print sample time, span and unit of a loop to standard error."""
    print(f"{loop.name}: {loop.summary}", file=sys.stderr)


def _three(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in next(csv.reader([text])))
    if len(names) != 3 or not all(names):
        raise argparse.ArgumentTypeError(f"{text!r} is not TAG,TIME,VALUE")
    return names


def _pair(text: str) -> tuple[str, str]:
    tag, sign, column = text.partition("=")
    if not sign or not tag or not column:
        raise argparse.ArgumentTypeError(f"{text!r} is not TAG=COL")
    return tag, column
