"""``stiction convert``: a record from CSV to bag and from bag to CSV."""

import argparse
import sys
from pathlib import Path
from typing import Any

from stiction_ros.cli.shared import intake_options as intake
from stiction_ros.errors import InputError
from stiction_ros.records.csv_writer import write_csv
from stiction_ros.records.run.record_to_bag import write_bag


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "convert",
        description="Write a record in another form: OUT ending in .csv becomes a CSV file, "
        "anything else a rosbag2 directory. Rows whose times are slightly irregular are "
        "a sample each; a record with gaps, or of several runs, becomes OUT_1, OUT_2 and so on. "
        "What was done is told.",
    )
    intake.add_record(parser)
    parser.add_argument("out", metavar="OUT", help="F.csv, or the directory of a new bag")
    parser.add_argument(
        "--iso", action="store_true", help="write times of a CSV file in ISO 8601 (UTC)"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    out = Path(options.out)
    to_csv = out.suffix.lower() == ".csv"
    if options.iso and not to_csv:
        raise InputError("is for CSV files", where="--iso", fix="let OUT end in .csv")
    records = intake.opened(options).parts
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
