"""``stiction identify``: friction, process and a verdict per valve from one record."""

import argparse
import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared import intake_options as intake
from stiction_ros.cli.shared import searches
from stiction_ros.cli.shared.as_json import write_json
from stiction_ros.cli.shared.progress import bar
from stiction_ros.errors import storing
from stiction_ros.records.parts import longest_part
from stiction_ros.texts import plural, probability, symbol

if TYPE_CHECKING:
    from stiction_ros.identification import Identification, ValveEstimate


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
        type=searches.output_orders,
        metavar="N[,N]",
        help="order n_a of the process (default: by BIC); methods of the paper take one order, "
        "or one for each output",
    )
    option(
        "--nb",
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

    plain = searches.refuse_channel_orders(options, chosen)
    settings = IdentificationOptions(
        output_order=plain["na"],
        input_order=plain["nb"],
        delay=options.delay,
        law=options.law,
        kind=options.kind,
    )
    search = searches.identify_by(options.method, settings, chosen)
    with bar("identifying") as show:
        found = search(record, show)
    if options.model is not None:
        from stiction_ros.identification.answer.identified_loop import identified_loop

        searches.write_model(options.model, lambda name: identified_loop(record, found, name))
    document = {"record": str(options.record)} | found.to_dict()
    if options.json is not None:
        write_json(options.json, document)
    if options.json != "-":
        print(f"{loop.name}: {loop.summary}")
        _print(document, found)
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


def _print(document: Mapping[str, Any], found: "Identification") -> None:
    from stiction_ros.identification.answer.summary import cycle, materiality, next_step, rows, why

    console = Console()
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    further = _further(found)
    table.add_column("valve", overflow="fold")
    heads = ["verdict", "P", "f_S %", "interval", "f_D %", "interval"]
    for name in (*heads, *(each for head in further.values() for each in (head, "interval"))):
        table.add_column(name, no_wrap=True)
    for valve, cells in zip(found.valves, rows(found), strict=True):
        table.add_row(*cells, *(cell for key in further for cell in _cells(valve, key)))
    console.print(table)
    console.print(
        "P: probability of friction. After a reversal OP goes back by f_S + f_D (deadband plus "
        "stickband) before the stem moves; the stem jumps by f_S − f_D. All in % of travel."
    )
    if found.row_samples > 1:
        used = found.row_samples * found.sample_time
        console.print(f"Friction was judged at a coarser rate: one row each {used:g} s.")
    for output in found.outputs:
        delays = ", ".join(f"{k} {plural(lag, 'sample')}" for k, lag in output.delay.items())
        console.print(
            f"{output.name}: delay from {delays}; fit {output.fit_one_step:.1f} % one sample "
            f"ahead, {output.fit_free_run:.1f} % from OP alone (free run); standard deviation of "
            f"the noise {output.noise_std:.3g} PV units"
        )
        if output.cause is not None:
            console.print(cycle(output))

    for j, valve in enumerate(found.valves):
        said = (why(found, j), materiality(valve), f"Next: {next_step(found, j)}")
        console.print(f"{valve.name}: {' '.join(filter(None, said))}")
    if any(valve.verdict == "undecided" for valve in found.valves):
        planned = shlex.join(["stiction", "valve-test", "plan", document["record"]])
        console.print(f"A test in manual that would decide: {planned}")
    for note in found.notes:
        console.print(f"note: {note}")


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


def _further(found: "Identification") -> dict[str, str]:
    """Return the heads of the columns of the law's further parameters, by their keys."""
    from stiction_ros.identification.friction import find_law

    heads = {}
    for valve in found.valves:
        for entry in find_law(valve.law).parameters()[2:] if valve.further else ():
            name = symbol(entry.key)
            heads[entry.key] = name if entry.unit == "1" else f"{name} {entry.unit}"
    return heads


def _cells(valve: "ValveEstimate", key: str) -> tuple[str, str]:
    """Return value and interval of a further parameter; a constant of the law is held."""
    if key not in valve.further:
        return "", ""
    ends = valve.further_intervals.get(key)
    between = "held" if ends is None else "{:.3g} to {:.3g}".format(*ends)
    return f"{valve.further[key]:.3g}", between
