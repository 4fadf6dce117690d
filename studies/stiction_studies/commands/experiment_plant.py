"""``stiction experiment plant``: a folder of exports whose truth is known."""

import argparse
import functools
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stiction_ros.errors import InputError
from stiction_studies.seeds import add_jobs, run_each

if TYPE_CHECKING:
    from stiction_studies.field.exports.plant import PlantLoop


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "experiment",
        description="plant: simulate many loops of a plant and write the exports of its historian, "
        "in five forms and with everything wrong that exports have; the truth stands beside.",
    )
    option = parser.add_argument
    option("name", choices=("plant",), help="the experiment")
    option("--loops", type=int, default=500, metavar="N", help="number of loops of a plant (500)")
    option("--seed", type=int, default=1, metavar="N", help="seed of the loops (1)")
    option("--out", required=True, metavar="DIR", help="folder to write")
    add_jobs(parser)
    parser.set_defaults(run=run)


def made(seed: int, number: int) -> "PlantLoop":
    """Return one loop of a plant; a worker process can run it."""
    from stiction_studies.field import field_loop
    from stiction_studies.field.exports.plant import loop_seed, plant_loop

    return plant_loop(field_loop(loop_seed(seed, number)), seed, number)


def run(options: argparse.Namespace) -> int:
    """Make a plant and write it."""
    from stiction_studies.field.exports.plant import export_plant

    if options.loops < 1:
        raise InputError(f"{options.loops} is too few", where="--loops", fix="use 1 or more")
    if options.seed < 0:
        raise InputError(f"{options.seed} is negative", where="--seed", fix="use 0 or more")
    work = functools.partial(made, options.seed)
    loops = run_each(work, range(options.loops), options.jobs, f"plant: {options.loops} loops")
    truth = export_plant(loops, options.seed, Path(options.out))
    print(f"{options.out}: {len(loops)} loops; the truth: {truth}", file=sys.stderr)
    return 0
