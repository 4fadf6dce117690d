"""``stiction soak``: a long run with the real nodes."""

import argparse
import math
import signal
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.node_processes import require_ros
from stiction_ros.cli.shared.progress import bar
from stiction_ros.cli.shared.scenarios import find, node_parameters
from stiction_ros.errors import InputError, storing
from stiction_ros.settings import settings_of
from stiction_studies.faults.terms import Pace

if TYPE_CHECKING:
    from stiction_studies.faults.soak import Soaked


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "soak",
        description="Run the nodes of a scenario as processes for hours. Fails when a sample was "
        "missed, or when a node's memory has grown since a tenth of the run (docs/faults.md).",
    )
    parser.add_argument(
        "scenario",
        nargs="?",
        default="siso",
        metavar="SCENARIO",
        help="siso, tank, or a file (siso)",
    )
    parser.add_argument("--hours", type=float, metavar="H", help="hours of wall time")
    parser.add_argument("--samples", type=int, metavar="N", help="samples, in place of hours")
    parser.add_argument(
        "--pace",
        choices=[p.value for p in Pace],
        default="lockstep",
        help="pace of the loop (lockstep)",
    )
    parser.add_argument(
        "--speed", type=float, default=100.0, metavar="N", help="speed in realtime pace (100)"
    )
    parser.add_argument("--out", metavar="DIR", help="folder for bag and logs")
    parser.add_argument("--json", metavar="F", help="write the figures; - for stdout")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    if options.hours is None and options.samples is None:
        raise InputError("neither --hours nor --samples", fix="say how long")
    for name in ("hours", "samples", "speed"):
        value = getattr(options, name)
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"{value:g} is not positive", where=f"--{name}")
    require_ros()
    signal.signal(signal.SIGTERM, _interrupt)
    if options.out is None:
        with tempfile.TemporaryDirectory(prefix="stiction_soak_") as folder:
            found = _soak(options, Path(folder))
    else:
        found = _soak(options, _made(Path(options.out)))
    hand_over(options.json, found.to_dict(), lambda: _print(options.scenario, found))
    return 1 if found.reasons else 0


def parameters(options: argparse.Namespace, directory: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters of the nodes; the plant's samples cover the hours asked for."""
    from stiction_ros.online.session import NODE_SETTINGS

    nodes = node_parameters(find(options.scenario), directory)
    samples = options.samples or 0
    nodes["plant"]["samples"] = samples
    for name, values in nodes.items():
        known = {entry.name for entry in settings_of(NODE_SETTINGS[name])}
        shared = {"pace": options.pace}
        if options.pace == Pace.REALTIME:
            shared["speed"] = options.speed
        values.update({key: value for key, value in shared.items() if key in known})
    return nodes


def _soak(options: argparse.Namespace, directory: Path) -> "Soaked":
    from stiction_studies.faults.soak import soak

    seconds = math.inf if options.hours is None else 3600.0 * options.hours
    with bar(f"soak {options.scenario}") as show:
        return soak(parameters(options, directory), directory, seconds, show)


def _made(directory: Path) -> Path:
    with storing(directory, what="made", fix="choose another folder by --out"):
        directory.mkdir(parents=True)
    return directory


def _print(name: str, found: "Soaked") -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    minutes = found.seconds / 60
    console.print(f"{name}: {found.samples} samples in {minutes:.1f} minutes")
    _list(console, "missed", found.missed)
    _list(console, "told besides", found.told)
    _list(console, "samples of the past kept at most", found.kept)
    table = Table("node", "RSS at a tenth, MB", "at the end, MB", "ratio")
    for node, memory in found.memory.items():
        sizes = (f"{memory.tenth / 1e6:.1f}", f"{memory.end / 1e6:.1f}")
        table.add_row(node, *sizes, f"{memory.ratio:.3f}")
    console.print(table)
    for reason in found.reasons:
        console.print(f"{name}: {reason}", markup=False)


def _list(console: Any, what: str, values: Mapping[str, object]) -> None:
    told = ", ".join(f"{key} {value}" for key, value in values.items())
    console.print(f"{what}: {told or 'nothing told'}", markup=False)


def _interrupt(_number: int, _frame: Any) -> None:
    raise KeyboardInterrupt
