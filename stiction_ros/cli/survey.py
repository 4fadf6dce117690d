"""``stiction survey``: every loop of a plant, ranked by what to service first."""

import argparse
import contextlib
import dataclasses
import datetime
import importlib.util
import json
import os
import sys
import threading
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared import intake_options as intake
from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.progress import bar
from stiction_ros.cli.shared.searches import add_law, delay_range
from stiction_ros.errors import InputError, foreign, storing
from stiction_ros.intake.sheets.cells import Numbers
from stiction_ros.intake.tables.tags import list_rows
from stiction_ros.texts import spoken

if TYPE_CHECKING:
    from stiction_ros.survey.entry import Entry
    from stiction_ros.survey.listing.headline import Earlier
    from stiction_ros.survey.survey import Progress, Survey

LOCAL = "local"  # the engine of this machine

PAGE, CSV, XLSX = "survey.html", "survey.csv", "survey.xlsx"
SHOWN = 30  # rows of the list that are printed
COLUMNS = (
    *("rank", "loop", "valve", "friction f_S", "OP lost", "probability", "cycles by"),
    "|PV−SP| after service",
)
ALWAYS, CAUSE = 3, 6  # columns that are always there, and the first that is broken between words
APART = 2  # blanks between two columns


def print_list(found: "Survey", earlier: "Sequence[Earlier]") -> None:
    """Print the first rows, in the words of the page; ``earlier`` surveys begin with the oldest."""
    from stiction_ros.survey.listing.headline import changed, headline, worked

    entries = found.entries[:SHOWN]
    console = Console()
    console.print(_table(entries, console.width))
    for entry in entries:
        if entry.reason:
            console.print(f"{entry.name}: {entry.reason}", highlight=False, markup=False)
    if len(found.entries) > SHOWN:
        console.print(f"and {len(found.entries) - SHOWN} more")
    for group in found.groups:
        names = ", ".join(group.names)
        console.print(f"group {group.number}, period {spoken(group.period)}: {names}")
    for line in changed(found.entries, earlier):
        console.print(line)
    console.print(headline(found), highlight=False)
    console.print(worked(found))


def _table(entries: "Sequence[Entry]", width: int) -> Table:
    """Return the columns of the page that fit, the most telling first; no word is broken."""
    from stiction_ros.survey.listing.columns import columns_of

    known = {column.head: column for column in columns_of(entries, ())}
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    left, kept = width, list[list[str]]()
    for place, head in enumerate(head for head in COLUMNS if head in known):
        cells, whole = [known[head].words(entry) for entry in entries], place < CAUSE
        words = [*head.split(), *(word for cell in cells for word in cell.split())]
        longest = max(map(len, [*head.split(), *cells] if whole else words))
        if any(cells) and (place < ALWAYS or left >= longest + APART):
            table.add_column(head, min_width=longest, no_wrap=whole, overflow="fold")
            left -= longest + APART
            kept.append(cells)
    for row in zip(*kept, strict=True):
        table.add_row(*row)
    return table


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "survey",
        description="Judge every loop in files and folders of exports and list the valves to "
        "service first, with a page for each loop. A loop that cannot be judged stands in the "
        "list with its reason and stops no other.",
    )
    option = parser.add_argument
    option("paths", nargs="+", metavar="PATH", help="files and folders of exports")
    intake.add_columns(parser)
    intake.add_intake(parser, many=True)
    option("--delay", type=delay_range, metavar="LO:HI", help="delays to try, samples (0:10)")
    add_law(parser)
    option("--no-gain", action="store_true", help="do not simulate what would help")
    option(
        "--cost", metavar="F", help="CSV with columns loop,cost: money per hour and unit of |PV−SP|"
    )
    option("--units", metavar="F", help="CSV with columns loop,unit: the unit of PV on the pages")
    option(
        "--previous",
        action="append",
        default=[],
        metavar="F",
        help="JSON of an earlier survey; may be repeated",
    )
    option("--out", metavar="DIR", help=f"write {PAGE}, {CSV}, {XLSX} and pages there")
    option("--json", metavar="F", help="write the result as JSON; - for stdout")
    option(
        "--jobs",
        type=int,
        default=os.cpu_count() or 1,
        metavar="N",
        help="number of processes (all cores)",
    )
    option(
        "--engine",
        default=LOCAL,
        metavar="E",
        help="where to judge: local, or dask://HOST:PORT (local)",
    )
    option("--resume", action="store_true", help="go on with the interrupted survey in --out")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    # Judging takes compiled code, which other commands do not wait for.
    from stiction_ros.identification.friction import find_law
    from stiction_ros.identification.identification_options import IdentificationOptions
    from stiction_ros.intake.intake import loops, strange_files
    from stiction_ros.survey.entry import SurveyOptions
    from stiction_ros.survey.survey import Plan, survey

    paths = [Path(path) for path in options.paths]
    for path in paths:
        if not path.exists():
            raise InputError("there is no such file or folder", where=str(path))
    reading = intake.intake_options(options)
    costs = _costs(options.cost)
    units = {name: unit for _, name, unit in _told(options.units, "unit")}
    identification = IdentificationOptions(law=options.law)
    find_law(identification.first_law)  # an unknown one stops the survey, and not every loop of it
    if options.delay is not None:
        identification = dataclasses.replace(identification, delay=options.delay)
    plan = Plan(
        SurveyOptions(
            identification,
            gain=not options.no_gain,
            pages=options.out is not None,
            units=tuple(units.items()),
            read_by=repr(reading),
        ),
        None if options.out is None else Path(options.out),
        options.resume,
        costs,
    )
    earlier = _earlier(options.previous)
    engine = _engine(options)
    counted = options.engine == LOCAL and sys.stderr.isatty()
    again = loops(paths, reading) if counted else None
    try:
        with progress(again) as show:
            found = survey(loops(paths, reading), plan, engine, show)
    except KeyboardInterrupt:
        if plan.out is not None:
            print("survey: interrupted; --resume goes on", file=sys.stderr)
        raise
    found = dataclasses.replace(
        found, date=datetime.datetime.now(datetime.UTC).isoformat(" ", "minutes")
    )
    there = {entry.name for entry in found.entries}
    for file, names in ((options.cost, costs), (options.units, units)):
        intake.tell_strangers(file, "loop", [name for name in names if name not in there])
    intake.tell_strangers(options.tags, "export", strange_files(paths, reading))
    if plan.out is not None:
        _write(found, plan.out, earlier)
    hand_over(options.json, found.to_dict(), lambda: print_list(found, earlier))
    list_at = "no list and no page was written; --out DIR writes them"
    if plan.out is not None:
        list_at = f"list: {plan.out / PAGE}"
    print(list_at, file=sys.stderr)
    statuses = {entry.status.value for entry in found.entries}
    return 1 if statuses == {"failed"} else 0


@contextlib.contextmanager
def progress(found: Iterable[object] | None) -> "Iterator[Progress]":
    """Show how far a survey is: loops that are done, of all that there are.

    The loops are found once more, to be counted beside the work; None where reading them twice
    costs too much.
    """
    totals: list[int] = []

    def count(loops: Iterable[object]) -> None:
        with contextlib.suppress(ValueError, OSError):  # who judges the loops is told as well
            totals.append(sum(1 for _ in loops))

    def tell(done: int, drawn: int, entry: "Entry") -> None:
        if not totals:
            show(0.0, f"{done} loops: {entry.name}")
            return
        total = max(totals[0], drawn)
        show(done / total, f"{done} of {total} loops: {entry.name}")

    if found is not None:
        threading.Thread(target=count, args=(found,), daemon=True).start()
    with bar("survey") as show:
        yield tell


def _engine(options: argparse.Namespace) -> Any:
    if options.engine == LOCAL:
        from stiction_ros.survey.engines.local import LocalEngine

        if options.jobs < 1:
            raise InputError(f"{options.jobs} is no number of processes", where="--jobs")
        return LocalEngine(options.jobs)
    from stiction_ros.survey.engines.dask import DaskEngine

    return DaskEngine(options.engine)


def _write(found: Any, out: Path, earlier: Sequence[Any]) -> None:
    from stiction_ros.survey.listing.page import list_page
    from stiction_ros.survey.listing.tables import write_csv, write_xlsx

    with storing(out):
        (out / PAGE).write_text(list_page(found, earlier), encoding="utf-8")
        write_csv(out / CSV, found.entries)
        if importlib.util.find_spec("openpyxl") is not None:
            write_xlsx(out / XLSX, found.entries)


def _told(file: str | None, what: str) -> list[tuple[str, str, str]]:
    """Return place, loop and ``what`` is told of it, of each row of a list of loops."""
    if file is None:
        return []
    with foreign(file):
        rows = list_rows(Path(file), {"loop", what}.issubset, f"name them loop,{what}")
        return [(where, row["loop"], row[what]) for where, row in rows if row["loop"]]


def _costs(file: str | None) -> dict[str, float]:
    """Return the cost of each loop; numbers are written as in exports, with point or comma."""
    found = {}
    for where, name, text in _told(file, "cost"):
        cells = Numbers(decimal_comma=True)
        cells.add([text])
        value = float(cells.values()[0])
        if not 0.0 <= value < float("inf"):
            said = f"{text!r} is no cost of loop {name}"
            raise InputError(said, where=where, fix="use a number of 0 or more")
        found[name] = value
    return found


def _earlier(files: Sequence[str]) -> list[Any]:
    """Return earlier surveys, in the order of the files."""
    from stiction_ros.survey.listing.headline import Earlier

    found = []
    for file in files:
        try:
            document = json.loads(Path(file).read_text(encoding="utf-8"))
            bands = {row["name"]: _band(row) for row in document["loops"]}
            found.append(Earlier(str(document.get("date", "")), bands))
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"cannot be read ({error})", where=file) from None
        except (json.JSONDecodeError, KeyError, TypeError, AttributeError):
            raise InputError(
                "is no result of a survey", where=file, fix="give what --json wrote"
            ) from None
    return found


def _band(row: dict[str, Any]) -> float | None:
    return None if row["f_s"] is None or row["f_d"] is None else float(row["f_s"] + row["f_d"])
