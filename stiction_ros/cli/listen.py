"""``stiction listen``: the windows of all loops in the graph, in one process."""

import argparse
import resource
import sys
import time
from pathlib import Path
from typing import Any

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.node_processes import require_ros
from stiction_ros.cli.shared.progress import bar
from stiction_ros.errors import InputError
from stiction_ros.records.csv_writer import write_csv


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "listen",
        description="Read pv and op_applied of every loop in the ROS graph and write one CSV "
        "record a loop, which identify takes. Nothing is published.",
    )
    option = parser.add_argument
    option("--seconds", type=float, required=True, help="how long to listen, s")
    option(
        "--sample-time",
        type=float,
        default=1.0,
        metavar="S",
        help="seconds between samples (default: 1)",
    )
    option("--window", type=int, default=5000, metavar="N", help="samples to keep of each loop")
    option("--out", metavar="DIR", help="folder of the CSV records; default: none")
    option("--json", metavar="F", help="write the number of samples of each loop; - for stdout")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    require_ros()
    for key in ("seconds", "sample_time", "window"):
        if not getattr(options, key) > 0:
            raise InputError("is not positive", where=f"--{key.replace('_', '-')}")
    from stiction_ros.nodes.listener import Listener

    begin, listener = time.process_time(), Listener(options.sample_time, options.window)
    try:
        with bar("listening") as show:
            listener.run(options.seconds, show)
    finally:
        listener.close()
    windows = listener.windows
    if options.out:
        folder = Path(options.out)
        folder.mkdir(parents=True, exist_ok=True)
        for name, window in windows.items():
            record = window.record()
            if record is not None:
                write_csv(record, folder / f"{name}.csv")
    told = {
        "loops": {
            name: {"samples": w.samples, "missed": 0, "window": len(w), **w.pairs.counts}
            for name, w in windows.items()
        },
        "cpu_seconds": time.process_time() - begin,
        "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    total = sum(window.samples for window in windows.values())
    missed = sum(window.pairs.counts["missed"] for window in windows.values())
    said = f"{len(windows)} loops, {total} samples, {missed} missed"
    hand_over(options.json, told, lambda: print(said))
    if not windows:
        print(
            "stiction: nobody publishes pv and op_applied; does the bridge run, in this "
            "ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE?",
            file=sys.stderr,
        )
    return 0 if windows else 1
