"""The nodes of one loop as processes: started together, watched, ended in order."""

import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from stiction_ros.cli.shared.scenarios import STARTED, in_order, kind_of, write_parameters
from stiction_ros.config_files import config_directories, installation_prefixes
from stiction_ros.errors import InputError
from stiction_ros.orphans import DIE_WITH_PARENT

ENDED = ("plant", "opcua", "controller", "estimator", "recorder")  # who has readers goes first
PATIENCE = 60.0  # s for a node to end: one that was told to, and the plant after its goodbye
SILENCE = 180.0  # s without progress before the run is given up
_PROGRESS = re.compile(r"sample (\d+) of (\d+)")


class NodeError(Exception):
    """A node ended or stopped moving when it should not have; the text says which and why."""


class NodeProcesses:
    """The nodes of a loop in processes of their own, in a ROS domain of their own."""

    def __init__(self, nodes: Mapping[str, Mapping[str, Any]], directory: Path) -> None:
        """Write ``directory``/parameters.yaml and prepare logs; :meth:`start` starts."""
        self.directory = directory
        self._names = in_order(nodes, (*STARTED, "opcua"))
        self._parameters = directory / "parameters.yaml"
        write_parameters(nodes, self._parameters)
        self._processes: dict[str, subprocess.Popen[str]] = {}
        self._readers: list[threading.Thread] = []
        self._last: dict[str, str] = {}
        self.sample = 0
        self.samples = 0
        self._moved = time.monotonic()

    def start(self) -> None:
        environment = ros_environment()
        (self.directory / "log").mkdir(exist_ok=True)
        for name in self._names:
            command = [sys.executable, "-P", "-m", "stiction_ros.nodes", kind_of(name)]
            command += ["--ros-args", "--params-file", str(self._parameters)]
            space = name.rpartition("/")[0]
            process = subprocess.Popen(
                [*command, "-r", f"__ns:=/{space}"] if space else command,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                start_new_session=True,  # Ctrl-C comes to us; we end the nodes in order
            )
            self._processes[name] = process
            reader = threading.Thread(target=self._read, args=(name, process), daemon=True)
            reader.start()
            self._readers.append(reader)
        self._moved = time.monotonic()

    def wait(self, progress: Callable[[float], None]) -> None:
        """Wait until the plant has run all; NodeError if a node ends before, or all stand."""
        plant = self._processes["plant"]
        while plant.poll() is None:
            for name, process in self._processes.items():
                if name != "plant" and process.poll() is not None:
                    self._forgive(name, process.returncode)
            if time.monotonic() - self._moved > SILENCE:
                raise NodeError(f"no sample for {SILENCE:.0f} s at sample {self.sample}")
            progress(self.sample / max(self.samples, 1))
            try:
                plant.wait(0.1)
            except subprocess.TimeoutExpired:
                continue
        if plant.returncode != 0:
            raise NodeError(self._describe("plant", plant.returncode))

    def require_running(self) -> None:
        """Raise NodeError when one of the nodes has ended."""
        for name, process in self._processes.items():
            if process.poll() is not None:
                raise NodeError(self._describe(name, process.returncode))

    def _forgive(self, name: str, code: int) -> None:
        """Let a node end cleanly a moment before the plant, which says goodbye first."""
        try:
            if code != 0:
                raise NodeError(self._describe(name, code))
            self._processes["plant"].wait(PATIENCE)
        except subprocess.TimeoutExpired:
            raise NodeError(self._describe(name, code)) from None

    def stop(self) -> None:
        """End every node, in an order in which nobody's last message is lost."""
        for name in in_order(self._processes, ENDED):
            process = self._processes[name]
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                try:
                    process.wait(PATIENCE)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
        for reader in self._readers:
            reader.join(5.0)

    def check(self) -> None:
        """Raise NodeError when a node that was stopped did not end cleanly."""
        for name, process in self._processes.items():
            if process.returncode != 0:
                raise NodeError(self._describe(name, process.returncode))

    def _read(self, name: str, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with (self.directory / "log" / f"{name.replace('/', '_')}.log").open(
            "w", encoding="utf-8", buffering=1
        ) as log:
            for line in process.stdout:
                log.write(line)
                self._last[name] = line.strip()
                found = _PROGRESS.search(line) if name == "plant" else None
                if found:
                    self.sample, self.samples = int(found[1]), int(found[2])
                    self._moved = time.monotonic()

    def _describe(self, name: str, code: int | None) -> str:
        said = self._last.get(name, "")
        return f"node {name} ended with code {code}" + (f": {said}" if said else "")


def ros_environment() -> dict[str, str]:
    """Return the environment of the nodes: this machine only, a domain of its own.

    ``ROS_DOMAIN_ID`` and the discovery range are left alone where they are set.
    """
    environment = dict(os.environ)
    environment["AMENT_PREFIX_PATH"] = os.pathsep.join(installation_prefixes())
    environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    environment.setdefault("ROS_DOMAIN_ID", str(random.SystemRandom().randint(1, 100)))
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        environment.setdefault(variable, "1")
    environment[DIE_WITH_PARENT] = str(os.getpid())
    for directory in config_directories():
        profile = directory / "fastdds.xml"
        if profile.is_file():
            environment.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(profile))
            break
    return environment


def require_ros() -> None:
    """Raise InputError when ROS 2 for Python is not installed."""
    import importlib.util

    if importlib.util.find_spec("rclpy") is None:
        raise InputError(
            "ROS 2 for Python (rclpy) is not installed",
            fix="run make setup, or source a ROS 2 Jazzy installation",
        )
