"""``stiction demo``: a live loop from limit cycle to compensation, recorded and reported."""

import argparse
import shutil
import signal
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stiction_ros.cli import extensions
from stiction_ros.cli.shared.node_processes import NodeError, NodeProcesses, require_ros
from stiction_ros.cli.shared.progress import Bar, bar
from stiction_ros.cli.shared.scenarios import ALL, SCENARIOS, find, loop_nodes
from stiction_ros.errors import InputError, storing

if TYPE_CHECKING:
    from stiction_ros.online.session import Scenario
    from stiction_ros.online.unit import UnitScenario
    from stiction_ros.report.run.story import Story


OPCUA = "opcua"
OPCUA_HELP = "; opcua: the tank behind a control system"


def add(commands: Any) -> None:
    """Add the command to the parser."""
    opcua, compare = extensions.part("demo opcua"), extensions.part("demo --compare")
    parser = commands.add_parser(
        "demo",
        description="Start plant, controller, estimator and recorder as processes; let the loop "
        "cycle; identify the friction; swap the controller; record all traffic; write the report.",
    )
    parser.add_argument(
        "scenario",
        nargs="*",
        metavar="SCENARIO",
        help=f"{', '.join(ALL)}, or a file (default: {' and '.join(SCENARIOS)})"
        + (OPCUA_HELP if opcua else ""),
    )
    parser.add_argument(
        "--out", default="out", metavar="DIR", help="folder of the results (default: out)"
    )
    parser.add_argument("--seed", type=int, metavar="N", help="seed of the noise")
    parser.add_argument(
        "--speed",
        default="max",
        type=_speed,
        metavar="max|N",
        help="lockstep as fast as possible, or N simulated seconds per second (default: max)",
    )
    if compare is not None:
        compare.add_options(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    compare = extensions.part("demo --compare")
    if compare is not None:
        if options.compare:
            return int(compare.run(options))
        compare.refuse_options(options)
    names = options.scenario or SCENARIOS
    paths = [find(name) for name in names if name != OPCUA]
    opcua = extensions.part("demo opcua") if OPCUA in names else None
    if OPCUA in names and opcua is None:
        extensions.refuse("demo opcua")
    from stiction_ros.online.unit import load_scenario

    scenarios = [load_scenario(path) for path in paths]
    require_ros()
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C
    good = True
    if opcua is not None:
        directory = Path(options.out) / OPCUA
        opcua.require()
        _make_empty(directory)
        with bar(f"{OPCUA}: starting") as show:
            good = opcua.run(directory, options.seed, options.speed, show)
    for scenario in scenarios:
        directory = Path(options.out) / scenario.name
        _make_empty(directory)
        with bar(f"{scenario.name}: starting") as show:
            good = _run_scenario(scenario, directory, options, show) and good
    return 0 if good else 1


def _run_scenario(
    scenario: "Scenario | UnitScenario", directory: Path, options: argparse.Namespace, show: Bar
) -> bool:
    """Run one scenario and print what its page says first; return whether it succeeded."""
    from stiction_ros.online.session import Scenario
    from stiction_ros.records.run.log import read_run
    from stiction_ros.report.run.report import report_run
    from stiction_ros.report.run.story import tell

    name = scenario.name
    nodes = loop_nodes(scenario.path, directory, seed=options.seed, speed=options.speed)
    processes = NodeProcesses(nodes, directory)
    begin = time.monotonic()
    try:
        try:
            processes.start()
            processes.wait(lambda share: show(0.9 * share, f"{name}: running"))
        finally:
            processes.stop()
        processes.check()
    except NodeError as failure:
        print(f"stiction: {name}: {failure}; see {directory / 'log'}", file=sys.stderr)
        return False
    seconds = time.monotonic() - begin
    show(0.92, f"{name}: reporting")
    if not isinstance(scenario, Scenario):
        return _report_unit(scenario, directory, seconds)
    story = tell(read_run(directory / "bag"), scenario=scenario)
    page, summary = report_run(story, directory, seconds)
    show(1.0)
    _print(story, summary)
    print(page)
    return bool(summary["status"] == "ok")


def _report_unit(scenario: "UnitScenario", directory: Path, seconds: float) -> bool:
    """Write the page of all loops and print what it says; return whether the run succeeded."""
    from stiction_ros.records.run.log import read_runs
    from stiction_ros.report.page import write_page
    from stiction_ros.survey import unit

    report = unit.unit_report(read_runs(directory / "bag", scenario.members), scenario)
    page = write_page(directory, unit.unit_page(report), unit.unit_summary(report, seconds))
    for line in report.found.sentences:
        print(f"{scenario.name}: {line}")
    print(page)
    return report.status == "ok"


def _print(story: "Story", summary: dict[str, Any]) -> None:
    """Print what the page says first, and what is wrong with the run."""
    from stiction_ros.report.run.report import findings, headline

    name = story.name
    for line in (headline(story), *findings(story)):
        print(f"{name}: {line}")
    if summary["pv_to_op_ms"]:
        times = ", ".join(f"{key} {value:.3g}" for key, value in summary["pv_to_op_ms"].items())
        print(f"{name}: PV to OP in ms: {times}")
    for topic, count in summary["messages"].items():
        lost = (count["published"] or 0) - count["recorded"]
        if lost > 0:
            print(f"{name}: warning: {lost} messages of {topic} are not in the bag")
    if summary["status"] != "ok":
        print(f"{name}: {summary['reason']}")


def _make_empty(directory: Path) -> None:
    """Make the folder, and remove what an earlier run of the demo left in it."""
    if directory.exists() and any(directory.iterdir()):
        if not (directory / "parameters.yaml").is_file():
            raise InputError(
                "holds other files", where=str(directory), fix="choose another folder by --out"
            )
        shutil.rmtree(directory)
    with storing(directory, what="made"):
        directory.mkdir(parents=True, exist_ok=True)


def _speed(text: str) -> float | None:
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not speed > 0:
        raise argparse.ArgumentTypeError(f"{text!r} is neither max nor a positive number")
    return speed
