"""``stiction convert``: a record from CSV to bag and from bag to CSV."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from stiction_ros.cli.identify import add_columns, columns
from stiction_ros.errors import InputError
from stiction_ros.records.bag_reader import read_bag_parts
from stiction_ros.records.csv_file import CsvColumns, read_csv_parts
from stiction_ros.records.csv_writer import write_csv
from stiction_ros.records.open_record import is_bag
from stiction_ros.records.record import Record
from stiction_ros.records.record_to_bag import write_bag


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "convert",
        help="convert a record between CSV and bag",
        description="Write a record in another form: OUT ending in .csv becomes a CSV file, "
        "anything else a rosbag2 directory. Slightly irregular samples are brought onto a "
        "regular grid; a record with gaps, or of several runs, becomes OUT_1, OUT_2 and so on. "
        "What was done is told.",
    )
    parser.add_argument("record", metavar="RECORD", help="CSV file or bag")
    parser.add_argument("out", metavar="OUT", help="F.csv, or the directory of a new bag")
    add_columns(parser)
    parser.add_argument(
        "--iso", action="store_true", help="time stamps in ISO 8601 (UTC) in a CSV file"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    out = Path(options.out)
    to_csv = out.suffix.lower() == ".csv"
    if options.iso and not to_csv:
        raise InputError("is for CSV files", where="--iso", fix="let OUT end in .csv")
    records = _read(options)
    for number, record in enumerate(records, start=1):
        target = out if len(records) == 1 else out.with_name(f"{out.stem}_{number}{out.suffix}")
        print(f"{target}: {len(record)} samples of {record.sample_time:g} s", file=sys.stderr)
        for note in record.notes:
            print(f"note: {note}", file=sys.stderr)
        if to_csv:
            write_csv(record, target, iso=options.iso)
        else:
            write_bag(record, target)
    return 0


def _read(options: argparse.Namespace) -> tuple[Record, ...]:
    chosen = columns(options)
    if not is_bag(options.record):
        if options.namespace is not None:
            raise InputError("is for bags", where="--namespace", fix="leave it out")
        return read_csv_parts(options.record, chosen)
    if chosen != CsvColumns():
        raise InputError(
            "is a bag, which has no columns",
            where=str(options.record),
            fix="leave --op, --pv, --sp, --stem and --time out",
        )
    return read_bag_parts(options.record, namespace=options.namespace)
