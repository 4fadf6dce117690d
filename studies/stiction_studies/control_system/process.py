"""The simulated plant as a process of its own: certificates, accounts, journal, clients."""

import dataclasses
import datetime
import json
import os
import secrets
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel
from stiction_ros.opcua.security import (
    CLIENT_URI,
    Credentials,
    Identity,
    make_certificate,
    write_secret,
)
from stiction_ros.orphans import DIE_WITH_PARENT
from stiction_studies.control_system.hands import PlantHand
from stiction_studies.control_system.tags import (
    OPERATION,
    REMOTE_USE,
    SERVER_URI,
    TESTING,
    tag_map_of,
)

MODEL = "tank.loop.yaml"
PI = ({"gain": 40.0, "integral_time": 900.0}, {"gain": 3.0, "integral_time": 600.0})
ACCOUNTS = {"bridge": (REMOTE_USE,), "reader": (), "operator": (OPERATION,), "tester": (TESTING,)}
LISTENING = b"listening"
READY = 60.0  # s for the server to start, and to end
MARGIN = datetime.timedelta(hours=1)  # by which clocks may differ


class PlantError(Exception):
    """The process of the plant ended, or does not start."""


@dataclasses.dataclass(frozen=True)
class PlantOptions:
    """How the plant runs."""

    speed: float = 600.0  # seconds of the plant per second
    watchdog: float = 5.0  # s without a beat after which its PIs take over
    rate: float = 0.25  # of a remote OP, as the tag map says it, % per second of the plant's time
    # of remote OPs, as the tag map says them, %; None for those of the valves
    limits: tuple[float, float] | None = None
    seed: int = 1  # of the noise
    start: int = 1_700_000_000_000_000_000  # the plant's time at the first sample, ns
    set_points: str | None = "tank.set_points.yaml"  # schedule file; None for set-points that stay
    history: bool = False  # whether values are kept for clients that read history


class PlantProcess:
    """Server of the simulated tank; its files lie below a folder.

    ``secrets/`` holds certificates, keys and passwords, ``tank.tags.yaml`` is the tag map,
    ``journal.jsonl`` all that happened, ``log/plant.log`` what the process has said.
    """

    def __init__(
        self,
        folder: Path,
        options: PlantOptions = PlantOptions(),
        users: Sequence[str] = tuple(ACCOUNTS),
    ) -> None:
        """Make all files; :meth:`start` starts the server.

        Args:
            folder: need not exist.
            options: of the plant.
            users: of :data:`ACCOUNTS` who get an account.
        """
        self.folder, self.options, self.users = folder, options, tuple(users)
        self.secrets = folder / "secrets"
        self.trusted = self.secrets / "trusted"
        self.journal = folder / "journal.jsonl"
        self.map_file = folder / "tank.tags.yaml"
        self.port = free_port()
        self.url = f"opc.tcp://127.0.0.1:{self.port}/plant"
        self.model = LoopModel.load(find_config(MODEL))
        self.trusted.mkdir(mode=0o700, parents=True)
        self.certificate("server", server=True)
        self.certificate("client")
        (self.secrets / "client.der").rename(self.trusted / "client.der")
        for user in self.users:
            write_secret(self.password_file(user), secrets.token_urlsafe(24).encode())
        told = tag_map_of(self.model, self.url, options.rate, options.watchdog)
        if options.limits is not None:
            for valve in told["loops"][0]["valves"]:
                valve["limits"] = list(options.limits)
        self.map_file.write_text(yaml.safe_dump(told, sort_keys=False), encoding="utf-8")
        self._log = folder / "log" / "plant.log"
        self._log.parent.mkdir()
        self._process: subprocess.Popen[bytes] | None = None
        self._begun: float | None = None
        self._events: list[dict[str, Any]] = []
        self._journal_read = 0  # bytes of the journal that stand in _events
        self._hands: dict[str, PlantHand] = {}

    def certificate(
        self,
        name: str,
        *,
        server: bool = False,
        begin: datetime.datetime | None = None,
        days: int = 2,
    ) -> None:
        """Make ``secrets/NAME.der`` and ``NAME.pem``, of the client unless of the ``server``."""
        begin = begin or datetime.datetime.now(datetime.UTC).replace(microsecond=0) - MARGIN
        uri = SERVER_URI if server else CLIENT_URI
        identity = Identity(uri, ("127.0.0.1",), server, begin, days)
        make_certificate(identity, self.secrets / f"{name}.der", self.secrets / f"{name}.pem")

    def password_file(self, user: str) -> Path:
        """Return the file of a user's password."""
        return self.secrets / f"{user}.password"

    def credentials(self, user: str = "bridge", **changes: str) -> Credentials:
        """Return those of a user, with ``changes``; all with full paths."""
        told = {
            "certificate": self.trusted / "client.der",
            "private_key": self.secrets / "client.pem",
            "server_certificate": self.secrets / "server.der",
            "password_file": self.password_file(user),
        }
        paths = {key: str(path.resolve()) for key, path in told.items()}
        return Credentials(**{"user": user, **paths, **changes})

    def node_parameters(self) -> dict[str, Any]:
        """Return the parameters of a node ``opcua`` that listens to the plant."""
        told = self.credentials()
        return {
            "tags": str(self.map_file.resolve()),
            "certificate": told.certificate,
            "private_key": told.private_key,
            "server_certificate": told.server_certificate,
            "user": told.user,
            "password_file": told.password_file,
            "publishing": 0.02,
            "speed": self.options.speed,
        }

    # ---- the process -----------------------------------------------------------------------

    def start(self) -> None:
        """Start the server and wait until it listens.

        A plant that is started again has lived on meanwhile, as far as its clock goes, and its
        controllers begin at their last OP.

        Raises:
            PlantError: it does not start.
        """
        path = self.secrets / "plant.yaml"
        path.unlink(missing_ok=True)
        write_secret(path, yaml.safe_dump(self._settings()).encode())
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "stiction_studies.control_system", str(path)],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, DIE_WITH_PARENT: str(os.getpid())},
                start_new_session=True,
            )
        end = time.monotonic() + READY
        while LISTENING not in self._log.read_bytes():
            self.require_running()
            if time.monotonic() > end:
                raise PlantError("the plant's server does not start")
            time.sleep(0.05)

    def _settings(self) -> dict[str, Any]:
        options, now = self.options, time.monotonic()
        begun = self._begun if self._begun is not None else now
        self._begun = begun
        step = round(self.model.sample_time * 1e9)
        scans = round((now - begun) * options.speed * 1e9) // step
        settings: dict[str, Any] = {
            "model": str(find_config(MODEL)),
            "pi": [dict(one) for one in PI],
            "watchdog": options.watchdog,
            "accounts": [
                {
                    "name": user,
                    "password": self.password_file(user).read_text(encoding="utf-8"),
                    "writes": list(ACCOUNTS[user]),
                }
                for user in self.users
            ],
            "port": self.port,
            "certificate": str(self.secrets / "server.der"),
            "private_key": str(self.secrets / "server.pem"),
            "trusted": str(self.trusted),
            "speed": options.speed,
            "start": options.start + scans * step,
            "seed": options.seed,
            "journal": str(self.journal),
            "history": options.history,
        }
        if options.set_points is not None:
            settings["set_points"] = str(find_config(options.set_points))
        outs = self.events("out")
        if outs:
            settings["out"] = outs[-1]["out"]
        return settings

    @property
    def pid(self) -> int:
        """Number of the process."""
        assert self._process is not None
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process is there."""
        return self._process is not None and self._process.poll() is None

    def require_running(self) -> None:
        """Raise PlantError when the process has ended."""
        if self._process is not None and self._process.poll() is not None:
            raise PlantError(f"the plant ended with code {self._process.returncode}")

    def stop(self, number: int = signal.SIGTERM) -> int:
        """End the process by a signal; return its code, 0 when there is none."""
        process, self._process = self._process, None
        if process is None:
            return 0
        if number == signal.SIGKILL:
            process.kill()  # before its clients can say goodbye
        for hand in self._hands.values():
            hand.close()
        self._hands.clear()
        process.send_signal(number)
        try:
            return process.wait(READY)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()

    # ---- what happened, and what others do -------------------------------------------------

    def events(self, kind: str = "") -> list[dict[str, Any]]:
        """Return what stands in the journal, all or of one kind."""
        if self.journal.exists():
            with self.journal.open("rb") as file:
                file.seek(self._journal_read)
                new = file.read()
            whole = new[: new.rfind(b"\n") + 1]
            self._journal_read += len(whole)
            self._events += [json.loads(line) for line in whole.splitlines()]
        return [one for one in self._events if not kind or one["event"] == kind]

    def write(self, name: str, value: Any, user: str) -> None:
        """Write a tag as ``user``; raises what the server answers."""
        if user not in self._hands:
            self._hands[user] = PlantHand(self.url, self.credentials(user))
        self._hands[user].write({name: value})

    def grant(self, mode: str = "ROUT") -> None:
        """Let the operator choose a mode."""
        self.write("LOOP.TARGET", mode, "operator")

    def disturb(self, name: str, value: float) -> None:
        """Put a fault into the server, or take it out by 0."""
        self.write(f"FAULT.{name}", float(value), "tester")


def free_port() -> int:
    """Return a TCP port of 127.0.0.1 that nobody listens on."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])
