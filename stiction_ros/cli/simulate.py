"""``stiction simulate``: a loop model in closed loop under its own controller."""

import argparse
import csv
import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.cli.shared.progress import bar
from stiction_ros.config_files import find_config
from stiction_ros.errors import foreign
from stiction_ros.loop import LoopModel, SetPoints, prbs_experiment, simulate
from stiction_ros.loop.excitation import simulate_open_loop
from stiction_ros.records.record import Record

SAMPLES, SEED = 2000, 1
PRBS = "prbs"


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "simulate",
        description="Run a loop model in closed loop under the controller that it records "
        "(controller: {kind: pi, …}), or in manual by moves, and write OP, PV, SP and the true "
        "stem position.",
    )
    parser.add_argument("loop", metavar="LOOP", help="loop model, F.loop.yaml")
    parser.add_argument(
        "--set-points", metavar="F", help="schedule of set-points (default: the operating point)"
    )
    parser.add_argument(
        "--moves",
        metavar="F.csv|prbs",
        help="in manual, by the moves that stiction valve-test writes; prbs: every valve without "
        "its effects by a random binary sequence of its own, as in Appendix A of the paper",
    )
    parser.add_argument(
        "--samples", type=int, default=SAMPLES, metavar="N", help=f"number of samples ({SAMPLES})"
    )
    parser.add_argument(
        "--seed", type=int, default=SEED, metavar="S", help=f"seed of the noise ({SEED})"
    )
    parser.add_argument(
        "--out",
        metavar="F.csv|BAG",
        help="CSV file, or the directory of a new bag (default: LOOP.csv in this folder)",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    path = find_config(options.loop)
    model = LoopModel.load(path)
    schedule = None
    if options.set_points is not None:
        schedule = SetPoints.load(find_config(options.set_points), model.outputs)
    out = Path(path.name.split(".")[0] + ".csv" if options.out is None else options.out)
    if options.moves == PRBS:
        write(prbs_experiment(model.with_ideal_valves(), options.samples, options.seed), out)
        told = f"{out}: {options.samples} samples; read it by"
        print(told, shlex.join(["stiction", "fit-linear", str(out)]), sep="\n", file=sys.stderr)
        return 0
    if options.moves is not None:
        write(by_hand(model, options.moves, options.seed), out)
        words = ["stiction", "valve-test", "judge", str(out)]
        print(f"{out}: a test in manual; judge it by", shlex.join(words), sep="\n", file=sys.stderr)
        return 0
    with bar(f"simulating {model.name}") as show:
        record = simulate(
            model,
            schedule,
            options.samples,
            options.seed,
            lambda done: show(done / options.samples),
        )
    write(record, out)
    told = f"{out}: {len(record)} samples of {record.sample_time:g} s; {moves(record)}."
    told += " STEM is the true stem, for comparison; identify does not use it. Read the record by"
    print(told, shlex.join(["stiction", "identify", str(out)]), sep="\n", file=sys.stderr)
    return 0


def by_hand(model: LoopModel, moves: str, seed: int) -> Record:
    """Return the record of a loop of one valve in manual.

    OP rests where the moves end for as long as the first of them is held, and then makes them. They
    are those of a CSV file with the columns ``after``, s since the first move, and ``OP``, %.
    """
    with foreign(moves), Path(moves).open(encoding="utf-8", newline="") as file:
        rows = [(float(row["after"]), float(row["OP"])) for row in csv.DictReader(file)]
        after, op = np.array(rows).T
        holds = np.round(np.diff(after, append=2.0 * after[-1] - after[-2]) / model.sample_time)
        path = np.repeat(np.append(op[-1], op), np.append(holds[0], holds).astype(int))
    return simulate_open_loop(model, path[:, None], seed).record


def write(record: Record, out: Path) -> None:
    """Write ``record`` as a CSV file where ``out`` ends in .csv, else as a bag."""
    if out.suffix.lower() == ".csv":
        from stiction_ros.records.csv_writer import write_csv

        write_csv(record, out)
        return
    from stiction_ros.records.run.record_to_bag import write_bag

    write_bag(record, out)


def moves(record: Record) -> str:
    """Return how often each stem moved, in words."""
    stem = record.op if record.stem is None else record.stem
    counts = np.count_nonzero(np.diff(stem, axis=0), axis=0)
    return ", ".join(
        f"the stem of {valve} moved at {count} of them"
        for valve, count in zip(record.valves, counts.tolist(), strict=True)
    )
