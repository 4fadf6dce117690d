"""``stiction identify``: friction, process and a verdict per valve from one record."""

import argparse
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared import intake_options as intake
from stiction_ros.cli.shared import searches
from stiction_ros.cli.shared.as_json import write_json
from stiction_ros.cli.shared.progress import bar
from stiction_ros.errors import storing
from stiction_ros.records.parts import longest_part
from stiction_ros.texts import probability

if TYPE_CHECKING:
    from stiction_ros.identification import Identification


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "identify",
        description="Identify the friction of every valve and the process behind it from "
        "controller output and measurement, and say which valve sticks. Of a record with gaps "
        "or of several runs the longest good part is taken.",
    )
    option = parser.add_argument
    intake.add_record(parser)
    option(
        "--na",
        dest="output_order",
        type=searches.output_orders,
        metavar="N[,N]",
        help="order n_a of the process (default: by BIC); methods of the paper take one order, "
        "or one for each output",
    )
    option(
        "--nb",
        dest="input_order",
        type=searches.input_orders,
        metavar="N[,N][/N,N]",
        help="order n_b of the process (default: n_a); methods of the paper take one order, or "
        "one for each valve in a row for each output",
    )
    searches.add_delay(parser, "delays to try")
    searches.add_law(parser)
    option(
        "--kind",
        choices=searches.LOOP_KINDS,
        help="what the loop controls; a note says whether the process found fits it",
    )
    option(
        "--method",
        default="evidence",
        choices=searches.METHODS,
        help="method of identification (default: evidence)",
    )
    searches.add_search_options(parser)
    option("--model", metavar="F.loop.yaml", help="write the identified loop as a loop model")
    option("--why", action="store_true", help="print the figures behind each probability")
    option("--json", metavar="F", help="write the result as JSON; - for stdout")
    option("--out", metavar="DIR", help="write the page report.html there")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    loop = intake.opened(options)
    record, parts = longest_part(loop.parts), loop.parts
    chosen = searches.search_options(options)
    from stiction_ros.identification import IdentificationOptions

    shared = {key: getattr(options, key) for key in searches.ORDERS if key not in chosen}
    settings = IdentificationOptions(
        **shared, delay=options.delay, law=options.law, kind=options.kind
    )
    search = searches.identify_by(options.method, settings, chosen)
    with bar("identifying") as show:
        found = search(record, show)
    if options.model is not None:
        from stiction_ros.identification.answer.identified_loop import identified_loop

        searches.write_model(options.model, lambda name: identified_loop(record, found, name))
    if options.json is not None:
        write_json(options.json, {"record": str(options.record)} | found.to_dict())
    if options.json != "-":
        print(f"{loop.name}: {loop.summary}")
        _print(str(options.record), found)
        if options.why:
            _print_figures(found)
    else:
        intake.tell(loop)
    if options.out is not None:
        from stiction_ros.report.record_page import report_record

        directory = Path(options.out)
        with storing(options.out, what="made"):
            directory.mkdir(parents=True, exist_ok=True)
        page = report_record(record, found, directory, parts)
        print(f"report: {page}", file=sys.stderr)
    return 0


def _print(record: str, found: "Identification") -> None:
    from stiction_ros.identification.answer.summary import summary

    print(summary(found, notes=None))
    if any(valve.verdict == "undecided" for valve in found.valves):
        planned = shlex.join(["stiction", "valve-test", "plan", record])
        print(f"A test in manual that would decide: {planned}")


def _print_figures(found: "Identification") -> None:
    """Print the figures of each valve, and what each adds to the log odds of friction."""
    from stiction_ros.identification.judgement import contributions, definitions

    console = Console()
    for valve in found.valves:
        if valve.figures is None:
            console.print(f"{valve.name}: this method computes no probability of friction")
            continue
        table = Table(
            title=f"{valve.name}: probability of friction {probability(valve.probability)}; "
            "log odds above 0 speak for friction",
            title_justify="left",
        )
        for name in ("figure", "value", "unit", "log odds", "definition"):
            table.add_column(name)
        odds = contributions(valve.figures)
        for name, told in definitions().items():
            value = getattr(valve.figures, name)
            row = name, f"{value:.3g}", told["unit"], f"{odds[name]:+.2f}", told["definition"]
            table.add_row(*row)
        console.print(table)
