"""``stiction bench world``: the discrepancy workflow over loops that share nothing with it."""

import argparse
import dataclasses
import itertools
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.errors import InputError, storing
from stiction_ros.texts import json_text
from stiction_studies.benches.accuracy.gap import GapBench, judged_rows, matrix_table, rate_table
from stiction_studies.commands import choices
from stiction_studies.judged_log import keep_row

if TYPE_CHECKING:
    from stiction_studies.blind.scores.world_scores import WorldScore

FIRST_SEED = 100_000  # seeds below 1000 are for tuning
LOG = "bench_world.jsonl"

Case = tuple[str, str, int]  # family, kind of model, seed


@dataclasses.dataclass(frozen=True)
class WorldBench(GapBench):
    """What is run: the same with one kind of model or several."""

    first: int = FIRST_SEED
    givens: tuple[str, ...] = ("exact",)
    keys: ClassVar[tuple[str, ...]] = ("family", "given", "seed")

    def __post_init__(self) -> None:
        super().__post_init__()
        if "outside" in self.families:
            raise InputError(
                "no loop of the field lies outside the catalogue",
                where="--family outside",
                fix="use stiction bench gap for it",
            )
        if choices.PROCESS in self.families and len(self.families) > 1:
            raise InputError(
                "its table is its own", where="--family process", fix="run it by itself"
            )

    @property
    def cases(self) -> list[Case]:
        """Family, kind of model and seed of every loop."""
        return list(itertools.product(self.families, self.givens, self.seeds))


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the option that ``bench gap`` has not."""
    group = parser.add_argument_group("world; --family to --resume as for gap")
    group.add_argument(
        "--given",
        action="append",
        choices=choices.GIVEN,
        help="the loop model knows the plant exactly, or is off by 3 to 10 %%; may be repeated "
        "(exact)",
    )


def run(options: argparse.Namespace, machine: str) -> int:
    """Run the benchmark."""
    from stiction_studies.blind import wrong_process
    from stiction_studies.blind.scores.world_scores import WorldScore
    from stiction_studies.blind.scores.world_tally import report

    bench = WorldBench.of(options)
    if bench.families == (choices.PROCESS,):
        return wrong_process.run(bench.first, bench.loops, options)
    if options.write is not None:
        write_loops(bench, Path(options.write))
        return 0
    rows = judged_rows(bench, options, LOG, WorldScore.from_mapping, judge)
    hand_over(
        options.json, {"name": "world", "machine": machine} | report(rows), lambda: show(rows)
    )
    return 0


def judge(full: bool, log: Path, case: Case) -> "WorldScore":
    """Run the workflow on one loop and compare; it sees model and record alone."""
    from stiction_ros.discrepancy import GapOptions, find_discrepancy
    from stiction_ros.loop import LoopModel
    from stiction_studies.blind.scores.world_scores import claimed, score
    from stiction_studies.field.hidden import hidden_loop
    from stiction_studies.field.hidden.oracle import oracle

    family, given, seed = case
    loop = hidden_loop(seed, family, given)
    model = LoopModel.from_mapping(loop.given)
    begun = time.process_time()
    found = find_discrepancy(model, [loop.record], GapOptions(quick=not full))
    seconds = time.process_time() - begun
    row = score(loop, given, found.to_dict(), oracle(loop), seconds)
    row = dataclasses.replace(row, claims=claimed(loop, found))
    keep_row(log, full, row.to_mapping())
    return row


def write_loops(bench: WorldBench, folder: Path) -> None:
    """Write every loop to ``folder/loops/FAMILY_MODEL_SEED``, its answer to ``folder/answers``."""
    from stiction_ros.loop import LoopModel
    from stiction_ros.records.csv_writer import write_csv
    from stiction_studies.field.hidden import hidden_loop

    for family, given, seed in bench.cases:
        loop = hidden_loop(seed, family, given)
        name = f"{family}_{given}_{seed}"
        seen, answers = folder / "loops" / name, folder / "answers"
        answer = {
            "cause": loop.cause,
            "hidden": [dataclasses.asdict(effect) for effect in loop.hidden],
            "also": sorted(loop.also),
            "surroundings": dataclasses.asdict(loop.surroundings),
        }
        with storing(seen):
            seen.mkdir(parents=True, exist_ok=True)
            answers.mkdir(parents=True, exist_ok=True)
            write_csv(loop.record, seen / "record.csv")
            LoopModel.from_mapping(loop.given).save(seen / "model.loop.yaml")
            (answers / f"{name}.json").write_text(json_text(answer) + "\n", encoding="utf-8")


def show(rows: "Sequence[WorldScore]") -> None:
    """Print the matrix and the rates of every family and kind of model."""
    from stiction_studies.blind.scores.tally import matrix
    from stiction_studies.blind.scores.world_tally import median_closed, rates, seconds

    console = Console()
    for family, given in dict.fromkeys((row.family, row.given) for row in rows):
        part = [row for row in rows if (row.family, row.given) == (family, given)]
        console.print(f"family {family}, model {given}")
        console.print(matrix_table(matrix(part)))
        console.print(rate_table(rates(part)))
        console.print(_misses(part))
        middle, largest = seconds(part)
        console.print(
            f"closed by what was right, median: {median_closed(part):.3f} (>= 0.9); "
            f"seconds of CPU: {middle:.1f} in the median, {largest:.1f} at most"
        )


def _misses(rows: "Sequence[WorldScore]") -> Table:
    """Return the loops in which something is said that is not there, or nothing at all."""
    table = Table("seed", "hidden", "said", "oracle", "plant and circumstances")
    for row in rows:
        if row.alarm or (not row.healthy and not row.right):
            gains = f"{row.gain_over_none():.0f} / {row.gain():.0f}"
            place = " ".join((row.plant, *row.circumstances))
            table.add_row(str(row.seed), row.cause, row.said, gains, place)
    return table
