"""Nodes as single processes: unusable input is one line, an interrupt waits for nothing."""

import fcntl
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")

from stiction_ros.cli.shared.node_processes import ros_environment

PATIENCE = 60.0
LAST = "stiction_ros.online.input.port_health"  # what the controller imports last


def start(name: str, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    # Tests that run in the background inherit a SIGINT that is ignored.
    command = ["env", "--default-signal=INT", sys.executable, "-m", "stiction_ros.nodes", name]
    return subprocess.Popen(
        [*command, "--ros-args", *arguments],
        env=ros_environment() | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def read_until(process: subprocess.Popen[str], mark: str) -> list[str]:
    assert process.stderr is not None
    said = []
    for line in process.stderr:
        said.append(line.rstrip())
        if mark in line:
            return said
    raise AssertionError(f"{mark!r} was not said: {said}")


def workers_of(number: int) -> list[int]:
    """Return the ids of the processes that work for the node with the id ``number``."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            if parent == number and b"spawn_main" in (entry / "cmdline").read_bytes():
                found.append(int(entry.name))
        except OSError:  # it has ended meanwhile
            continue
    return found


@pytest.mark.parametrize(
    "arguments",
    [
        ["--params-file", "broken.yaml"],
        ["-p", "seed:"],
        ["-p", "sed:=1"],
        *(
            pytest.param(given, marks=pytest.mark.trial)
            for given in (
                ["--params-file", "none.yaml"],
                ["--params-file", "listed.yaml"],
                ["-r", "__ns:=/1 2"],
                ["-p", "seed:=x"],
            )
        ),
    ],
)
def test_unusable_input_is_said_without_a_traceback(arguments: list[str], tmp_path: Path) -> None:
    (tmp_path / "broken.yaml").write_text("plant: [")
    (tmp_path / "listed.yaml").write_text("plant: {ros__parameters: {changes: [{a: 1}]}}")
    given = [a if not a.endswith(".yaml") else str(tmp_path / a) for a in arguments]
    process = start("plant", *given)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2
    assert "Traceback" not in said
    own = [line for line in said.splitlines() if line.startswith("plant: ") or "[plant]" in line]
    assert len(own) == 1


@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.trial)]
)
def test_compilation_in_the_worker_is_not_waited_for(number: int, tmp_path: Path) -> None:
    process = start("estimator", NUMBA_CACHE_DIR=str(tmp_path))
    try:
        read_until(process, "not ready yet: the fits are being compiled")
        workers = workers_of(process.pid)
        assert workers
        for worker in workers:  # whoever waits for it waits in vain
            os.kill(worker, signal.SIGSTOP)
        process.send_signal(number)
        _, said = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert process.returncode == 0
    assert "Traceback" not in said


@pytest.mark.parametrize(
    "module",
    [
        "scipy",
        LAST,
        *(pytest.param(name, marks=pytest.mark.trial) for name in ("rclpy", "llvmlite")),
    ],
)
def test_a_node_that_is_being_built_is_broken_off(module: str) -> None:
    told = {"PYTHONPROFILEIMPORTTIME": "1"}  # it says what it has imported
    process = start("controller", "-p", "model:=example1_process.loop.yaml", **told)
    assert process.stderr is not None
    # With the least of pipes it cannot run far ahead of what is read here.
    fcntl.fcntl(process.stderr, fcntl.F_SETPIPE_SZ, 4096)
    try:
        read_until(process, module)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert process.returncode == 0
    assert "Traceback" not in said
    assert LAST not in said


def test_a_node_says_that_it_is_ready() -> None:
    process = start("controller", "-p", "model:=example1_process.loop.yaml")
    try:
        read_until(process, "controller is ready: alone")
    finally:
        os.kill(process.pid, signal.SIGTERM)
        process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
