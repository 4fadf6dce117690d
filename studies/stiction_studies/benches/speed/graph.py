"""``stiction bench graph``: a lockstep sample of the nodes against a bare echo."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.cli.shared.node_processes import NodeProcesses, require_ros, ros_environment
from stiction_ros.cli.shared.progress import Bar
from stiction_ros.cli.shared.scenarios import find, node_parameters
from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import read_raw
from stiction_studies.benches.speed.row import Row, row

ECHOES = 2000
SAMPLES = 1500
UNAWARE: Mapping[str, Any] = {"mode": "unaware"}
NAMES = ("lockstep sample, recorded", "echo between two processes")


def graph(show: Bar) -> list[Row]:
    """One lockstep sample with recording, against a bare echo of the same message.

    The echo is measured before and after; its median is over both.
    """
    require_ros()
    rows = []
    for name in ("siso", "tank"):
        first = _echo(name)
        cycle = _lockstep(name, UNAWARE, show)
        second = _echo(name)
        echo = np.concatenate([first, second])
        fitted = _lockstep(name, {}, show)
        note = f"{np.median(cycle) / np.median(echo):.2f} echoes per sample"
        rows.append(row(f"{name}, fits off", NAMES, cycle, echo, note))
        share = f"{fitted.mean():.2f} ms per sample on average, waits for fits included"
        note = f"{np.median(fitted) / np.median(echo):.2f} echoes per sample; {share}"
        rows.append(row(f"{name}, fits on", NAMES, fitted, echo, note))
    return rows


def _lockstep(name: str, controller: Mapping[str, Any], show: Bar) -> Any:
    """Return ms per sample of a recorded lockstep run."""
    with tempfile.TemporaryDirectory() as folder:
        bag = record_run(name, Path(folder), show, controller)
        sent = [m.publish_time for m in read_raw(bag) if m.topic.name == "/pv"]
    return np.diff(np.array(sent[len(sent) // 20 :])) / 1e6


def record_run(
    name: str, directory: Path, show: Bar, controller: Mapping[str, Any] = UNAWARE
) -> Path:
    """Run a scenario in lockstep and return its bag.

    Args:
        name: of the scenario.
        directory: for parameters, logs and the bag.
        show: progress.
        controller: parameters in place of the scenario's; with any there is no estimator.
    """
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
    return directory / "bag"


def _echo(name: str) -> Any:
    """Return round-trip times, ms, of the scenario's pv message between two processes."""
    names = {"siso": "PV1", "tank": "C,T"}[name]
    environment = ros_environment()
    base = [sys.executable, "-P", "-m", "stiction_studies.benches.speed.echo"]
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
