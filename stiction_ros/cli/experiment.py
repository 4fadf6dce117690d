"""``stiction experiment``: simulated identification experiments, written as records."""

import argparse
import shlex
import sys
from typing import Any

from stiction_ros.cli import extensions
from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel, prbs_experiment
from stiction_ros.records.csv_writer import write_csv

DEFAULT_MODEL = "tank.loop.yaml"
PRBS = (
    "prbs: simulate an open-loop experiment on a loop model, in which every valve, without its "
    "effects, moves by a random binary sequence of its own, as in Appendix A, and write its record."
)


def add(commands: Any) -> None:
    """Add the command to the parser."""
    plant = extensions.part("experiment plant")
    text = PRBS if plant is None else f"{PRBS} {plant.DESCRIPTION}"
    parser = commands.add_parser("experiment", description=text)
    option = parser.add_argument
    names = ("prbs",) if plant is None else ("prbs", "plant")
    option("name", metavar=f"{{{','.join(names)}}}", help="the experiment")
    option("--model", default=DEFAULT_MODEL, metavar="F", help=f"loop model ({DEFAULT_MODEL})")
    option("--seed", type=int, default=1, metavar="N", help="seed of moves and noise (1)")
    option("--samples", type=int, default=3000, metavar="N", help="number of samples (3000)")
    option("--out", required=True, metavar="F", help="file or folder to write")
    if plant is not None:
        plant.add_options(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    if options.name not in ("prbs", "plant"):
        raise InputError(
            f"unknown experiment {options.name!r}", where="stiction experiment", fix="use prbs"
        )
    if options.name == "plant":
        return int(extensions.needed_part("experiment plant").run_plant(options))
    if options.samples < 2:
        raise InputError(f"{options.samples} is too few", where="--samples", fix="use 2 or more")
    model = LoopModel.load(find_config(options.model)).with_ideal_valves()
    record = prbs_experiment(model, options.samples, options.seed)
    write_csv(record, options.out)
    command = shlex.join(["stiction", "fit-linear", options.out])
    print(f"{options.out}: {len(record)} samples; read it by\n{command}", file=sys.stderr)
    return 0
