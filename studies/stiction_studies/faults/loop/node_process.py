"""One node as a process that can be paused, killed and started again."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

PATIENCE = 20.0  # s for a node to end before it is killed
_PAGE = os.sysconf("SC_PAGE_SIZE")


class NodeProcess:
    """One node in a process of its own; its log goes on over restarts."""

    def __init__(
        self,
        kind: str,
        parameters: Mapping[str, Any],
        directory: Path,
        environment: Mapping[str, str],
        arguments: Sequence[str] = (),
        *,
        name: str = "",
    ) -> None:
        """Write the parameter file; :meth:`start` starts.

        Args:
            kind: plant, controller, estimator or recorder.
            parameters: of the node.
            directory: for ``NAME.yaml`` and ``NAME.log``.
            environment: of the process.
            arguments: more ROS arguments, such as ``-r pv:=pv_plant``.
            name: of files and node; the kind unless given.
        """
        self.kind, self.name = kind, name or kind
        self.by_fault = False
        self._arguments = list(arguments)
        if name and name != kind:
            self._arguments += ["-r", f"__node:={name}"]
        self._environment = dict(environment)
        self._file = directory / f"{self.name}.yaml"
        self._log = directory / f"{self.name}.log"
        document = {f"/**/{self.name}": {"ros__parameters": dict(parameters)}}
        self._file.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
        self._log.write_text("", encoding="utf-8")
        self._process: subprocess.Popen[str] | None = None
        self._reader: threading.Thread | None = None

    def start(self, arguments: Sequence[str] = ()) -> None:
        """Start the node (again), with more ROS ``arguments`` this time."""
        command = [sys.executable, "-P", "-m", "stiction_ros.nodes", self.kind, "--ros-args"]
        command += ["--params-file", str(self._file), *self._arguments, *arguments]
        self.by_fault = False
        self._process = subprocess.Popen(
            command,
            env=self._environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
        )
        self._reader = threading.Thread(target=self._read, args=(self._process,), daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """Number of the process."""
        assert self._process is not None
        return self._process.pid

    @property
    def code(self) -> int | None:
        """Exit code; None while it runs."""
        return None if self._process is None else self._process.poll()

    @property
    def log(self) -> str:
        """All that it has written."""
        return self._log.read_text(encoding="utf-8")

    def send(self, number: int) -> None:
        """Send a signal to a node that runs."""
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(number)

    def pause(self) -> None:
        """Stop the process where it is."""
        self.send(signal.SIGSTOP)

    def go_on(self) -> None:
        """Let a paused process go on."""
        self.send(signal.SIGCONT)

    def kill(self) -> None:
        """Kill the process, as a fault does."""
        self.by_fault = True
        self.send(signal.SIGKILL)
        self._wait(PATIENCE)

    def end(self) -> bool:
        """Ask the process to end, as Ctrl-C does; kill it and return False when it does not."""
        self.go_on()
        self.send(signal.SIGINT)
        if self._wait(PATIENCE):
            return True
        self.send(signal.SIGKILL)
        self._wait(PATIENCE)
        return False

    def resident(self) -> int | None:
        """Return the memory of the process that is in use, bytes; None once it has ended."""
        try:
            text = Path(f"/proc/{self.pid}/statm").read_text(encoding="ascii")
        except OSError:
            return None
        pages = int(text.split()[1])
        return pages * _PAGE or None

    def _wait(self, seconds: float) -> bool:
        if self._process is not None:
            try:
                self._process.wait(seconds)
            except subprocess.TimeoutExpired:
                return False
        if self._reader is not None:
            self._reader.join(5.0)
        return True

    def _read(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with self._log.open("a", encoding="utf-8") as log:
            for line in process.stdout:
                log.write(line)
                log.flush()
