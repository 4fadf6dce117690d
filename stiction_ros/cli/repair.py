"""``stiction repair``: finish or salvage a bag."""

import argparse
import dataclasses
from typing import Any

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.errors import InputError
from stiction_ros.records.bag.repair import Repair, RepairStatus, repair_bag

_SAID = {
    RepairStatus.WHOLE: "nothing to repair",
    RepairStatus.FINISHED: "finished, every complete message is kept",
    RepairStatus.SALVAGED: "salvaged, what is damaged is left out",
}


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "repair",
        description="Finish the files of a bag that its recorder did not close, save what is "
        "whole of damaged ones (these stay beside the new ones as *.mcap.damaged), and write "
        "metadata.yaml anew. A whole bag is left as it is.",
    )
    parser.add_argument("bag", metavar="BAG", help="rosbag2 directory or .mcap file")
    parser.add_argument("--json", metavar="F", help="write the result as JSON; - for stdout")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    try:
        done = repair_bag(options.bag)
    except OSError as error:
        raise InputError(
            f"cannot be rewritten ({error.strerror or error})", where=str(error.filename)
        ) from None
    hand_over(
        options.json,
        {"bag": str(options.bag)} | dataclasses.asdict(done),
        lambda: _print(options.bag, done),
    )
    return 0


def _print(bag: str, done: Repair) -> None:
    count = sum(done.messages.values())
    topics = sum(1 for number in done.messages.values() if number)
    print(f"{bag}: {_SAID[done.status]}; {count} messages on {topics} topics")
    for note in done.notes:
        print(f"note: {note}")
