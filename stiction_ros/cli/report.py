"""``stiction report``: the report of a bag."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from stiction_ros.cli.identify import add_columns, columns
from stiction_ros.identification import IdentificationOptions, identify
from stiction_ros.records.open_record import is_bag, open_record


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "report",
        help="make the report of a bag or a record",
        description="Make a self-contained HTML report of a bag, or of a CSV record.",
    )
    parser.add_argument("record", metavar="BAG_OR_RECORD", help="bag or CSV file")
    add_columns(parser)
    parser.add_argument("--out", default="report", metavar="DIR", help="folder (default: report)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    from stiction_ros.report.record_report import report_record
    from stiction_ros.report.run_report import report_run

    directory = Path(options.out)
    directory.mkdir(parents=True, exist_ok=True)
    if is_bag(options.record):
        print(report_run(options.record, directory).page)
        return 0
    record = open_record(options.record, columns(options))
    print(report_record(record, identify(record, IdentificationOptions()), directory))
    return 0
