"""``stiction fit-linear``: a linear model of a record, without friction."""

import argparse
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared import intake_options as intake
from stiction_ros.cli.shared import searches
from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.progress import bar
from stiction_ros.records.parts import longest_part

if TYPE_CHECKING:
    from stiction_ros.identification.linear.result import LinearIdentification


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "fit-linear",
        description="Fit a linear model from OP to PV and write it as a loop model. Exit code 1 "
        "when there is no stable model.",
    )
    intake.add_record(parser)
    parser.add_argument("--order", type=int, metavar="N", help="number of states (default: by BIC)")
    parser.add_argument(
        "--method",
        default="cva",
        choices=searches.SUBSPACE_METHODS,
        help="projection of the states; predictor for records of a closed loop (cva)",
    )
    parser.add_argument(
        "--criterion", default="bic", choices=searches.CRITERIA, help="criterion of the order (bic)"
    )
    searches.add_delay(parser, "delays to try")
    parser.add_argument("--json", metavar="F", help="write the result as JSON; - for stdout")
    parser.add_argument("--out", metavar="F", help="write the loop model, F.loop.yaml")
    parser.add_argument(
        "--limits", type=limits_range, metavar="LO:HI", help="limits of the valves in the model, %%"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    loop = intake.opened(options)
    record = longest_part(loop.parts)
    from stiction_ros.identification.linear.data import LinearStatus, OrderCriterion
    from stiction_ros.identification.linear.fit import LinearOptions, fit_linear
    from stiction_ros.signals.subspace_projection import SubspaceMethod

    settings = LinearOptions(
        order=options.order,
        delay=options.delay,
        criterion=OrderCriterion(options.criterion),
        method=SubspaceMethod(options.method),
    )
    with bar("fitting") as show:
        found = fit_linear(record, settings, progress=show)
    told = {"record": str(options.record)} | found.to_dict()
    hand_over(options.json, told, lambda: _print(f"{loop.name}: {loop.summary}", found))
    if found.status is LinearStatus.UNSTABLE:
        return 1
    if options.out is not None:
        searches.write_model(options.out, lambda name: found.loop_model(name, options.limits))
    return 0


def _print(read: str, found: "LinearIdentification") -> None:
    """Print what was read of the record, then the model that was found."""
    print(read)
    console = Console()
    title = f"state space of order {found.order}, {found.samples} samples, {found.status}"
    table = Table(title=title, title_justify="left")
    heads = ["output", "delay", "one step %", "free run %", "noise"]
    heads += [f"gain {valve}" for valve in found.valves]
    for head in heads:
        table.add_column(head, justify="left" if head == "output" else "right")
    for i, tag in enumerate(found.outputs):
        table.add_row(
            tag,
            " ".join(map(str, found.delay[i].tolist())),
            f"{found.fit_one_step[i]:.2f}",
            f"{found.fit_free_run[i]:.2f}",
            f"{found.noise_std[i]:.4g}",
            *(f"{gain:.5g}" for gain in found.gain[i]),
        )
    console.print(table)
    for note in [found.reason, *found.notes]:
        if note:
            console.print(f"note: {note}")


def limits_range(text: str) -> tuple[float, float]:
    """Return ``LO:HI`` as two numbers, the first the smaller."""
    low, _, high = text.partition(":")
    try:
        limits = float(low), float(high)
    except ValueError:
        limits = 0.0, 0.0
    if not (np.isfinite(limits).all() and limits[0] < limits[1]):
        raise argparse.ArgumentTypeError(f"{text!r} are no limits, write 0:100")
    return limits
