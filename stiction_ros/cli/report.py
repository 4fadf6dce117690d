"""``stiction report``: the report of a bag."""

import argparse
from pathlib import Path
from typing import Any

from stiction_ros.cli.shared import intake_options as intake
from stiction_ros.errors import storing
from stiction_ros.intake.intake import is_bag
from stiction_ros.records.parts import longest_part


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "report", description="Make a self-contained HTML report of a bag, or of a CSV record."
    )
    intake.add_record(parser, metavar="BAG_OR_RECORD")
    parser.add_argument(
        "--out",
        default="report.html",
        metavar="F.html",
        help="the page, or a folder for the page; for a run also figures and summary.json "
        "(default: report.html)",
    )
    parser.set_defaults(run=run)


def holds_live_run(path: str) -> bool:
    """Return whether a bag tells of a controller or an estimator, not of signals alone."""
    from stiction_ros.records.bag.messages import read_raw

    names = {raw.topic.name.rpartition("/")[2] for raw in read_raw(path)}
    return bool(names & {"mode", "stiction", "loop_model"})


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    out = Path(options.out)
    with storing(out, fix="choose another --out"):
        if is_bag(options.record) and holds_live_run(options.record):
            from stiction_ros.records.run.log import read_run
            from stiction_ros.report.run.report import report_run
            from stiction_ros.report.run.story import tell

            log = read_run(options.record, namespace=options.namespace)
            print(report_run(tell(log), out)[0])
        else:
            loop = intake.opened(options)
            intake.tell(loop)
            record, parts = longest_part(loop.parts), loop.parts
            from stiction_ros.identification import IdentificationOptions, identify
            from stiction_ros.report.record_page import report_record

            found = identify(record, IdentificationOptions())
            print(report_record(record, found, out, parts))
    return 0
