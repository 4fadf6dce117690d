"""Nodes as single processes: unusable input is one line, an interrupt ends them soon."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")

from stiction_ros.cli.shared.node_processes import ros_environment

PATIENCE = 60.0
SOON = 1.0  # s from an interrupt to the end


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


@pytest.mark.parametrize(
    "arguments",
    [
        ["--params-file", "none.yaml"],
        ["--params-file", "broken.yaml"],
        ["--params-file", "listed.yaml"],
        ["-r", "__ns:=/1 2"],
        ["-p", "seed:"],
        ["-p", "seed:=x"],
        ["-p", "sed:=1"],
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


def test_a_file_whose_keys_do_not_fit_is_warned_of(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("plant: {ros__parameters: {model: example1.loop.yaml}}")
    process = start("plant", "-r", "__ns:=/unit1", "--params-file", str(path))
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2  # no model: nothing in the file was for this node
    assert said.count(f"{path} holds nothing for /unit1/plant, only for plant") == 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_compilation_in_the_worker_is_not_waited_for(number: int, tmp_path: Path) -> None:
    process = start("estimator", NUMBA_CACHE_DIR=str(tmp_path))
    try:
        read_until(process, "not ready yet: the fits are being compiled")
        begin = time.monotonic()
        process.send_signal(number)
        _, said = process.communicate(timeout=PATIENCE)
        assert time.monotonic() - begin < SOON
    finally:
        process.kill()
    assert process.returncode == 0
    assert "Traceback" not in said


@pytest.mark.parametrize("wait", [0.3, 1.0, 2.0])
def test_a_node_that_is_being_built_ends_soon(wait: float, tmp_path: Path) -> None:
    process = start(
        "controller", "-p", "model:=example1_process.loop.yaml", NUMBA_CACHE_DIR=str(tmp_path)
    )
    try:
        time.sleep(wait)  # there is nothing to wait on: any moment must do
        begin = time.monotonic()
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=PATIENCE)
        assert time.monotonic() - begin < SOON
    finally:
        process.kill()
    assert process.returncode == 0
    assert "Traceback" not in said


def test_a_node_says_that_it_is_ready() -> None:
    process = start("controller", "-p", "model:=example1_process.loop.yaml")
    try:
        read_until(process, "controller is ready: alone")
    finally:
        os.kill(process.pid, signal.SIGTERM)
        process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
