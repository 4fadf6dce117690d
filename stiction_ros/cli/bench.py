"""``stiction bench``: figures of speed, always as ratios of one run on one machine."""

from __future__ import annotations

import argparse
import dataclasses
import json
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.json_output import write_json
from stiction_ros.cli.node_processes import NodeProcesses, require_ros, ros_environment
from stiction_ros.cli.progress import Bar, bar
from stiction_ros.cli.scenarios import find, node_parameters
from stiction_ros.errors import InputError
from stiction_ros.records.bag_messages import read_raw

ECHOES = 2000
SAMPLES = 1500


@dataclasses.dataclass(frozen=True)
class Row:
    """One comparison; times are medians in ms, ``ratio`` = baseline / subject."""

    case: str
    subject: str
    baseline: str
    subject_ms: float
    baseline_ms: float
    p99_ms: float
    ratio: float
    note: str


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "bench",
        help="measure speed, side by side",
        description="Measure speed against a baseline in the same run. Benchmarks: "
        + ", ".join(BENCHMARKS),
    )
    parser.add_argument(
        "name", nargs="?", default="graph", choices=tuple(BENCHMARKS), help="default: graph"
    )
    parser.add_argument("--json", metavar="F", help="write the rows as JSON; - for stdout")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    with bar(f"bench {options.name}") as show:
        rows = BENCHMARKS[options.name](show)
    document = {
        "name": options.name,
        "machine": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "rows": [dataclasses.asdict(row) for row in rows],
    }
    if options.json is not None:
        write_json(options.json, document)
    if options.json != "-":
        table = Table()
        for name in ("case", "subject", "ms", "p99", "baseline", "ms", "baseline / subject"):
            table.add_column(name)
        for row in rows:
            table.add_row(
                row.case,
                row.subject,
                f"{row.subject_ms:.3f}",
                f"{row.p99_ms:.3f}",
                row.baseline,
                f"{row.baseline_ms:.3f}",
                f"{row.ratio:.3f}",
            )
        Console().print(table)
        for row in rows:
            Console().print(f"{row.case}: {row.note}")
    return 0


def graph(show: Bar) -> list[Row]:
    """One lockstep sample with recording, against a bare echo of the same message.

    The echo is measured before and after; its median is over both.
    """
    require_ros()
    rows = []
    for name in ("siso", "tank"):
        first = _echo(name)
        cycle = _lockstep(name, {"mode": "unaware"}, show)
        second = _echo(name)
        echo = np.concatenate([first, second])
        fitted = _lockstep(name, {}, show)
        note = f"{np.median(cycle) / np.median(echo):.2f} echoes per sample"
        rows.append(_row(f"{name}, fits off", cycle, echo, note))
        share = f"{fitted.mean():.2f} ms per sample on average, waits for fits included"
        note = f"{np.median(fitted) / np.median(echo):.2f} echoes per sample; {share}"
        rows.append(_row(f"{name}, fits on", fitted, echo, note))
    return rows


def _row(case: str, subject: Any, baseline: Any, note: str) -> Row:
    middle, base = float(np.median(subject)), float(np.median(baseline))
    return Row(
        case,
        "lockstep sample, recorded",
        "echo between two processes",
        middle,
        base,
        float(np.percentile(subject, 99)),
        base / middle,
        note,
    )


def _lockstep(name: str, controller: Mapping[str, Any], show: Bar) -> Any:
    """Return ms per sample of a recorded lockstep run."""
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder)
        nodes = node_parameters(find(name), directory)
        nodes["controller"].update(controller)
        if controller:
            nodes.pop("estimator")
            nodes["plant"]["samples"] = SAMPLES
            for node in nodes.values():
                node["wait_for"] = [w for w in node.get("wait_for", []) if w != "estimator"]
        processes = NodeProcesses(nodes, directory)
        try:
            processes.start()
            processes.wait(show)
        finally:
            processes.stop()
        processes.check()
        bag = directory / "bag"
        sent = [m.publish_time for m in read_raw(bag) if m.topic.name == "/pv"]
    return np.diff(np.array(sent[len(sent) // 20 :])) / 1e6


def _echo(name: str) -> Any:
    """Return round-trip times, ms, of the scenario's pv message between two processes."""
    names = {"siso": "PV1", "tank": "C,T"}[name]
    environment = ros_environment()
    base = [sys.executable, "-P", "-m", "stiction_ros.nodes.echo"]
    mirror = subprocess.Popen([*base, "mirror"], env=environment)
    try:
        done = subprocess.run(
            [*base, "time", names, str(ECHOES)],
            env=environment,
            capture_output=True,
            text=True,
            timeout=120,
        )
    finally:
        mirror.terminate()
        mirror.wait()
    if done.returncode != 0:
        raise InputError(f"the echo failed: {done.stderr.strip()[-300:]}", where="bench graph")
    return np.array(json.loads(done.stdout))


BENCHMARKS: dict[str, Callable[[Bar], list[Row]]] = {"graph": graph}
