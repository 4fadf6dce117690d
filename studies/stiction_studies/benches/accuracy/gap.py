"""``stiction bench gap``: the discrepancy workflow over blind loops, and its matrix."""

import argparse
import dataclasses
import functools
import json
import math
import multiprocessing
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.progress import bar
from stiction_ros.orphans import spared
from stiction_studies.commands import choices
from stiction_studies.judged_log import check_seeds, logged_rows, start_log
from stiction_studies.seeds import drop

if TYPE_CHECKING:
    from stiction_studies.blind.scores.scoring import Scored
    from stiction_studies.blind.scores.tally import Rate

FIRST_SEED = 10_000  # seeds below 1000 are for tuning
LOOPS = 20
LOG = "bench_gap.jsonl"


@dataclasses.dataclass(frozen=True)
class GapBench:
    """What is run."""

    families: tuple[str, ...] = ("single",)
    first: int = FIRST_SEED
    loops: int = LOOPS  # seeds of every family, from the first on
    full: bool = False  # bootstraps instead of stored thresholds

    def __post_init__(self) -> None:
        check_seeds(self.first, self.loops)

    @property
    def cases(self) -> list[tuple[str, int]]:
        """Family and seed of every loop."""
        seeds = range(self.first, self.first + self.loops)
        return [(family, seed) for family in self.families for seed in seeds]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this benchmark."""
    group = parser.add_argument_group("gap")
    group.add_argument(
        "--family",
        action="append",
        choices=(*choices.BLIND_FAMILIES, choices.PHYSICS, choices.PROCESS),
        help="family of loops; may be repeated (single); physics and process (a model with one "
        "figure wrong) are loops of bench world",
    )
    group.add_argument("--first", type=int, metavar="SEED", help=f"first seed ({FIRST_SEED})")
    group.add_argument("--loops", type=int, metavar="N", help=f"loops of each family ({LOOPS})")
    group.add_argument(
        "--full", action="store_true", default=None, help="with bootstraps, as gap without --quick"
    )
    group.add_argument("--jobs", type=int, metavar="N", help="processes (1)")
    group.add_argument("--log", metavar="F", help=f"where every loop's score is kept ({LOG})")
    group.add_argument(
        "--resume", action="store_true", default=None, help="leave out loops that the log has"
    )
    group.add_argument(
        "--write", metavar="DIR", help="write loops and answers there instead of judging any"
    )


def run(options: argparse.Namespace) -> int:
    """Run the benchmark."""
    from stiction_studies.blind.scores.tally import report

    chosen = {
        "families": tuple(dict.fromkeys(options.family)) if options.family else None,
        "first": options.first,
        "loops": options.loops,
        "full": options.full,
    }
    bench = GapBench(**{key: value for key, value in chosen.items() if value is not None})
    if options.write is not None:
        write_loops(bench, Path(options.write))
        return 0
    log = Path(options.log or LOG)
    rows = read_log(log, bench) if options.resume else {}
    todo = [case for case in bench.cases if case not in rows]
    if not options.resume:
        start_log(log)
    judge_all(todo, bench.full, options.jobs or 1, functools.partial(_keep, rows, log, bench.full))
    ordered = [rows[case] for case in bench.cases]
    hand_over(options.json, {"name": "gap"} | report(ordered), lambda: show(ordered))
    return 0


def judge(family: str, seed: int, full: bool) -> "Scored":
    """Run the workflow on one blind loop and compare; it sees model and record alone."""
    from stiction_ros.discrepancy import GapOptions, find_discrepancy
    from stiction_studies.blind.loops.generator import blind_loop
    from stiction_studies.blind.scores.scoring import score
    from stiction_studies.blind.testable import gains_beyond_margin

    seen, truth = blind_loop(seed, family)
    found = find_discrepancy(seen.model, [seen.record], GapOptions(quick=not full))
    return score(truth, seen.model, found.to_dict(), gains_beyond_margin(seen, truth))


def judge_all(
    cases: list[tuple[str, int]], full: bool, jobs: int, keep: "Callable[[Scored], None]"
) -> None:
    """Judge loops in worker processes and hand over every row as it comes."""
    if not cases:
        return
    context = multiprocessing.get_context("spawn")
    with (
        bar(f"{len(cases)} blind loops") as show_share,
        ProcessPoolExecutor(max(jobs, 1), mp_context=context) as pool,
    ):
        with spared():  # the first case starts the workers
            futures = [pool.submit(judge, family, seed, full) for family, seed in cases]
        try:
            for done, future in enumerate(as_completed(futures), start=1):
                keep(future.result())
                show_share(done / len(futures))
        except BaseException:
            drop(pool)
            raise


def read_log(path: Path, bench: GapBench) -> "dict[tuple[str, int], Scored]":
    """Return the rows of ``bench`` that the log has.

    Raises:
        InputError: a line that is no row.
    """
    from stiction_studies.blind.scores.scoring import Scored

    wanted = set(bench.cases)
    rows = logged_rows(path, bench.full, Scored.from_mapping)
    return {(row.family, row.seed): row for row in rows if (row.family, row.seed) in wanted}


def write_loops(bench: GapBench, folder: Path) -> None:
    """Write every loop to ``folder/loops/FAMILY_SEED`` and its answer to ``folder/answers``."""
    from stiction_studies.blind.loops.generator import write_blind_loop

    for family, seed in bench.cases:
        seen = folder / "loops" / f"{family}_{seed}"
        write_blind_loop(seed, family, seen, folder / "answers")


def show(rows: "Iterable[Scored]") -> None:
    """Print the matrix and the rates."""
    from stiction_studies.blind.scores.tally import coverage, matrix, median_closed, rates

    rows = list(rows)
    console = Console()
    console.print(matrix_table(matrix(rows)))
    console.print(rate_table([*rates(rows), *coverage(rows)]))
    console.print(f"closed by what was right, median: {median_closed(rows):.3f} (>= 0.9)")


def _keep(rows: "dict[tuple[str, int], Scored]", log: Path, full: bool, row: "Scored") -> None:
    rows[row.family, row.seed] = row
    with log.open("a", encoding="utf-8") as file:
        file.write(json.dumps({"full": full} | row.to_mapping()) + "\n")


def matrix_table(counts: Mapping[str, Mapping[str, int]]) -> Table:
    """Return what was said of what was hidden, the most frequent first."""
    table = Table("hidden", "loops", "said")
    for cause, said in counts.items():
        words = [f"{name} {count}" for name, count in sorted(said.items(), key=_by_count)]
        table.add_row(cause, str(sum(said.values())), ", ".join(words))
    return table


def _by_count(entry: tuple[str, int]) -> tuple[int, str]:
    return -entry[1], entry[0]


def rate_table(found: "list[Rate]") -> Table:
    """Return rates with what is wanted of them."""
    table = Table("rate", "count", "of", "share", "wanted")
    for rate in found:
        share = "-" if math.isnan(rate.share) else f"{100.0 * rate.share:.1f} %"
        table.add_row(rate.name, str(rate.count), str(rate.total), share, rate.wanted)
    return table
