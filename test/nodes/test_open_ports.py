"""What the package opens by default: no TCP port but that of the plant of the demonstration."""

import ast
import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")

from open_sockets import command_of, environment_of, family_of, listening_of

import stiction_ros

BUDGET = 600.0  # s; it begins late on a busy machine


@pytest.mark.trial
def test_the_demonstration_of_the_bridge_opens_one_port_of_this_machine(tmp_path: Path) -> None:
    pytest.importorskip("asyncua", reason="asyncua is not installed")
    demo = subprocess.Popen(
        [
            sys.executable,
            "-P",
            "-m",
            "stiction_ros.cli.main",
            *f"demo opcua --out {tmp_path}".split(),
        ],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        # A shell that runs the tests in the background lets its children ignore Ctrl-C.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    log = tmp_path / "opcua" / "log" / "opcua.log"
    try:
        end = time.monotonic() + BUDGET
        while not log.exists() or "opcua is ready" not in log.read_text():
            assert demo.poll() is None, "the demonstration has ended"
            assert time.monotonic() < end, "the bridge was never ready"
            time.sleep(0.05)
        family = family_of(demo.pid)
        found = {command_of(one): listening_of(one, may_have_none=True) for one in family}
        nodes = [one for one in family if "stiction_ros.nodes " in f"{command_of(one)} "]
        ranges = {environment_of(one).get("ROS_AUTOMATIC_DISCOVERY_RANGE") for one in nodes}
    finally:
        started = family_of(demo.pid)
        demo.send_signal(signal.SIGINT)
        try:
            demo.wait(BUDGET)
        except subprocess.TimeoutExpired:
            for one in started:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(one, signal.SIGKILL)
            raise
    server = yaml.safe_load((tmp_path / "opcua" / "tank.tags.yaml").read_text())["server"]
    address = re.fullmatch(r"opc\.tcp://127\.0\.0\.1:(\d+)/plant", server)
    assert address is not None
    (plant,) = [command for command in found if "stiction_studies.control_system" in command]
    assert found.pop(plant) == [f"0100007F:{int(address[1]):04X}"]
    assert {command: ports for command, ports in found.items() if ports} == {}
    assert len(nodes) >= 4
    assert ranges == {"LOCALHOST"}


OPENS = {  # what can listen, by its name in a call
    "bind",
    "create_server",
    "start_server",
    "start_unix_server",
    "listen",
    "set_endpoint",
    "HTTPServer",
    "TCPServer",
    "ThreadingHTTPServer",
    "LocalCluster",
    "Listener",
    "BaseManager",
    "SyncManager",
}
KNOWN = {
    ("stiction_ros/nodes/controller.py", "listen"),  # to topics
    ("stiction_ros/cli/listen.py", "Listener"),
    ("stiction_studies/control_system/server.py", "set_endpoint"),  # of the demonstration
    ("stiction_studies/control_system/process.py", "bind"),  # asks for a free port, lets it go
    ("stiction_studies/faults/bridge/relay.py", "create_server"),  # of the suite of faults
}


@pytest.mark.trial
def test_nothing_else_of_the_package_can_listen() -> None:
    root = Path(str(stiction_ros.__file__)).parents[1]
    packages = (root / "stiction_ros", root / "studies" / "stiction_studies")
    found = set()
    for path in (path for package in packages for path in package.rglob("*.py")):
        name = str(path.relative_to(root)).removeprefix("studies/")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                called = getattr(node.func, "attr", getattr(node.func, "id", ""))
                if called in OPENS:
                    found.add((name, called))
    assert found <= KNOWN
    assert {one for one in KNOWN if one[1] in ("set_endpoint", "create_server")} <= found
