"""``stiction replay``: estimator and controller once more over a recorded bag, without ROS."""

import argparse
from typing import TYPE_CHECKING, Any

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.progress import bar
from stiction_ros.records.storage.files import storage_files

if TYPE_CHECKING:
    from stiction_ros.online.replays.result import FitMatch, Replay


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "replay",
        description="Run estimator and controller over a recorded bag without ROS, with the "
        "settings that they told on ~/config, and compare every fit, op and change of mode with "
        "the recorded ones. Exit code 1 when anything differs.",
    )
    parser.add_argument("bag", metavar="BAG", help="rosbag2 directory or .mcap file")
    parser.add_argument(
        "--namespace", metavar="NS", help="namespace of the loop, where a bag holds several loops"
    )
    parser.add_argument("--json", metavar="F", help="write the result as JSON; - for stdout")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    storage_files(options.bag)  # a wrong path is told at once
    from stiction_ros.online.replays.result import Match
    from stiction_ros.online.replays.run import replay

    with bar("replaying") as show:
        found = replay(options.bag, namespace=options.namespace, progress=show)
    hand_over(
        options.json,
        found.to_dict() | {"bag": str(options.bag)},
        lambda: _print(str(options.bag), found),
    )
    return 1 if found.match is Match.DIFFERENT else 0


def _print(bag: str, found: "Replay") -> None:
    from rich.console import Console
    from rich.table import Table

    from stiction_ros.online.replays.result import Match

    console = Console()
    head = ("window ends", "valves", "replayed and recorded")
    table = Table(*head, title=f"{bag}: {found.samples} samples", title_justify="left")
    for fit in found.fits:
        difference = fit.comparison.difference
        said = str(fit.comparison.match).replace("_", " ") + (f": {difference}" * bool(difference))
        table.add_row(f"{found.seconds(fit.fit.stamp):.9g} s", _valves(fit), said)
    console.print(table)
    if found.op is not None:
        console.print(f"op: {found.op.equal} of {found.op.compared} samples are equal")
    if found.modes is not None:
        times = [
            "never" if change is None else f"at {found.seconds(change.stamp):.9g} s"
            for change in found.swaps
        ]
        console.print(f"swap: recorded {times[0]}, replayed {times[1]}")
        word = str(found.modes.match).replace("_", " ")
        console.print(f"changes of mode: {len(found.bag.modes)} recorded, {word}")
    if found.monitor is not None:
        looks, findings = found.monitor
        console.print(
            f"monitor: {looks.equal} of {looks.compared} measurements and "
            f"{findings.equal} of {findings.compared} findings are equal"
        )
    for note in found.notes:
        console.print(f"note: {note}")
    difference = found.first_difference
    last = {
        Match.EQUAL: "equal: the replay gives every compared number again, bit for bit",
        Match.DIFFERENT: f"different: {difference}",
        Match.NOT_COMPARED: "not compared: the bag holds nothing to compare with",
    }
    console.print(last[found.match])


def _valves(match: "FitMatch") -> str:
    update = match.fit.update
    if update is None:
        return match.fit.failure
    return ", ".join(
        f"{valve.name} {valve.verdict} (f_S {valve.static_friction:.2f}, "
        f"f_D {valve.dynamic_friction:.2f})"
        for valve in update.identification.valves
    )
