"""The nodes of a loop listen on no TCP port."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from small_loop import write_small_scenario

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")

from open_sockets import listening_of

from stiction_ros.cli.node_processes import NodeProcesses
from stiction_ros.cli.scenarios import loop_nodes

BUDGET = 60.0  # s
SPEED = 20.0  # samples per second: the run outlasts the look at it


def test_no_node_listens(tmp_path: Path) -> None:
    path = write_small_scenario(tmp_path)
    processes = NodeProcesses(loop_nodes(path, tmp_path, speed=SPEED), tmp_path)
    try:
        processes.start()
        end = time.monotonic() + BUDGET
        while processes.sample == 0:  # the plant runs, so that all have matched
            processes.require_running()
            assert time.monotonic() < end, "the plant never began"
            time.sleep(0.05)
        found = {name: listening_of(pid) for name, pid in processes.pids().items()}
    finally:
        processes.stop()
    assert found == {name: [] for name in ("plant", "controller", "estimator", "recorder")}
