"""``stiction bench gap``: the discrepancy workflow over blind loops, and its matrix."""

import argparse
import dataclasses
import functools
import itertools
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.errors import InputError
from stiction_studies.commands import choices
from stiction_studies.judged_log import keep_row, logged_rows, start_log
from stiction_studies.seeds import run_each

if TYPE_CHECKING:
    from stiction_studies.blind.scores.scoring import Scored
    from stiction_studies.blind.scores.tally import Rate

FIRST_SEED = 10_000  # seeds below 1000 are for tuning
LOOPS = 20
LOG = "bench_gap.jsonl"
Row = TypeVar("Row")


@dataclasses.dataclass(frozen=True)
class GapBench:
    """What is run."""

    families: tuple[str, ...] = ("single",)
    first: int = FIRST_SEED
    loops: int = LOOPS  # seeds of every family, from the first on
    full: bool = False  # bootstraps instead of stored thresholds

    @classmethod
    def of(cls, options: argparse.Namespace) -> Self:
        """Return what options ask for."""
        lists = {"families": options.family, "givens": options.given}
        given = vars(options) | {key: tuple(dict.fromkeys(v)) for key, v in lists.items() if v}
        names = (each.name for each in dataclasses.fields(cls))
        return cls(**{name: given[name] for name in names if given.get(name) is not None})

    def __post_init__(self) -> None:
        if self.loops < 1:
            raise InputError(f"{self.loops} loops", where="--loops", fix="use 1 up")
        if self.first < 0:
            raise InputError(f"{self.first} is negative", where="--first")

    keys: ClassVar[tuple[str, ...]] = ("family", "seed")  # of a row, by which a loop is known

    @property
    def cases(self) -> list[tuple[Any, ...]]:
        """Family and seed of every loop."""
        return list(itertools.product(self.families, self.seeds))

    @property
    def seeds(self) -> range:
        """Seeds of each family."""
        return range(self.first, self.first + self.loops)


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
    from stiction_studies.blind.scores.scoring import Scored
    from stiction_studies.blind.scores.tally import report

    bench = GapBench.of(options)
    if options.write is not None:
        write_loops(bench, Path(options.write))
        return 0
    rows = judged_rows(bench, options, LOG, Scored.from_mapping, judge)
    hand_over(options.json, {"name": "gap"} | report(rows), lambda: show(rows))
    return 0


def judged_rows(
    bench: "GapBench",
    options: argparse.Namespace,
    log: str,
    row_of: Callable[[Mapping[str, Any]], Row],
    judge: Callable[[bool, Path, Any], Row],
) -> list[Row]:
    """Return the row of every loop, of the log or judged now by worker processes, in their order.

    Args:
        bench: which loops.
        options: of the command.
        log: name of the log where none is given.
        row_of: makes a row of what the log has.
        judge: makes it of a loop and keeps it there.
    """
    path = Path(options.log or log)
    rows = read_log(path, bench, row_of) if options.resume else {}
    todo = [case for case in bench.cases if case not in rows]
    if not options.resume:
        start_log(path)
    work = functools.partial(judge, bench.full, path)
    judged = run_each(work, todo, options.jobs or 1, f"{len(todo)} loops")
    rows |= dict(zip(todo, judged, strict=True))
    return [rows[case] for case in bench.cases]


def judge(full: bool, log: Path, case: tuple[str, int]) -> "Scored":
    """Run the workflow on one blind loop and compare; it sees model and record alone."""
    from stiction_ros.discrepancy import GapOptions, find_discrepancy
    from stiction_studies.blind.loops.generator import blind_loop
    from stiction_studies.blind.scores.scoring import score
    from stiction_studies.blind.testable import gains_beyond_margin

    family, seed = case
    seen, truth = blind_loop(seed, family)
    found = find_discrepancy(seen.model, [seen.record], GapOptions(quick=not full))
    row = score(truth, seen.model, found.to_dict(), gains_beyond_margin(seen, truth))
    keep_row(log, full, row.to_mapping())
    return row


def read_log(
    path: Path, bench: "GapBench", row_of: Callable[[Mapping[str, Any]], Row]
) -> dict[tuple[Any, ...], Row]:
    """Return the rows of ``bench`` that the log has.

    Raises:
        InputError: a line that is no row.
    """
    rows = logged_rows(path, bench.full, row_of)
    by_case = {tuple(getattr(row, key) for key in bench.keys): row for row in rows}
    return {case: by_case[case] for case in bench.cases if case in by_case}


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
