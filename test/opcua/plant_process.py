"""The simulated plant as a process of its own, and clients that act on it."""

from __future__ import annotations

import asyncio
import datetime
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml
from asyncua import ua

from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel
from stiction_ros.opcua.plant.tags import NAMESPACE, SERVER_URI, tag_map_of
from stiction_ros.opcua.security import (
    CLIENT_URI,
    Credentials,
    Identity,
    make_certificate,
    write_secret,
)
from stiction_ros.opcua.session import node_ids, open_client
from stiction_ros.orphans import DIE_WITH_PARENT

BUDGET = 60.0  # s for anything to happen, on a busy machine
USERS = {
    "bridge": ["remote"],
    "reader": [],
    "operator": ["operation"],
    "tester": ["testing"],
}
START = 1_700_000_000_000_000_000


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def wait_until(condition: Callable[[], Any], what: str, pause: float = 0.01) -> Any:
    end = time.monotonic() + BUDGET
    while not (found := condition()):
        assert time.monotonic() < end, f"waited {BUDGET:g} s for {what}"
        time.sleep(pause)
    return found


class PlantProcess:
    """Certificates, accounts and the server of one simulated tank below a folder."""

    def __init__(
        self, folder: Path, *, speed: float = 600.0, watchdog: float = 2.0, **extra: Any
    ) -> None:
        self.folder, self.speed, self.watchdog = folder, speed, watchdog
        self.port = free_port()
        self.url = f"opc.tcp://127.0.0.1:{self.port}/plant"
        self.process: subprocess.Popen[str] | None = None
        self.journal = folder / "journal.jsonl"
        self.model = LoopModel.load(find_config("tank.loop.yaml"))
        (folder / "trusted").mkdir(parents=True)
        self.certificate("server", server=True)
        self.certificate("client")
        (folder / "client.der").rename(folder / "trusted" / "client.der")
        for user in USERS:
            write_secret(folder / f"{user}.password", f"{user}'s own word".encode())
        self.settings = {
            "model": str(find_config("tank.loop.yaml")),
            "set_points": str(find_config("tank.set_points.yaml")),
            "pi": [
                {"gain": 40.0, "integral_time": 900.0},
                {"gain": 3.0, "integral_time": 600.0},
            ],
            "watchdog": watchdog,
            "accounts": [
                {"name": name, "password": f"{name}'s own word", "writes": writes}
                for name, writes in USERS.items()
            ],
            "port": self.port,
            "certificate": str(folder / "server.der"),
            "private_key": str(folder / "server.pem"),
            "trusted": str(folder / "trusted"),
            "speed": speed,
            "start": START,
            "seed": 1,
            "journal": str(self.journal),
            **extra,
        }
        self.map_file = folder / "tank.tags.yaml"
        self.map_file.write_text(
            yaml.safe_dump(tag_map_of(self.model, self.url, 0.1, watchdog)), encoding="utf-8"
        )

    def certificate(
        self, name: str, *, server: bool = False, uri: str = "", begin: Any = None, days: int = 2
    ) -> None:
        start = begin or datetime.datetime.now(datetime.UTC) - datetime.timedelta(hours=1)
        uri = uri or (SERVER_URI if server else CLIENT_URI)
        identity = Identity(uri, ("127.0.0.1",), server, start, days)
        make_certificate(identity, self.folder / f"{name}.der", self.folder / f"{name}.pem")

    def word(self, user: str) -> str:
        """Return the file of a user's password."""
        return str(self.folder / f"{user}.password")

    def credentials(self, user: str = "bridge", **changes: str) -> Credentials:
        told = {
            "certificate": str(self.folder / "trusted" / "client.der"),
            "private_key": str(self.folder / "client.pem"),
            "server_certificate": str(self.folder / "server.der"),
            "user": user,
            "password_file": self.word(user),
        }
        return Credentials(**{**told, **changes})

    def parameters(self) -> dict[str, Any]:
        """Return the parameters of a node that bridges the plant, without writing."""
        told = self.credentials()
        return {
            "tags": str(self.map_file),
            "certificate": told.certificate,
            "private_key": told.private_key,
            "server_certificate": told.server_certificate,
            "user": told.user,
            "password_file": told.password_file,
            "publishing": 0.02,
            "speed": self.speed,
        }

    def start(self) -> None:
        path = self.folder / "plant.yaml"
        path.unlink(missing_ok=True)
        write_secret(path, yaml.safe_dump(self.settings).encode())
        environment = {**os.environ, DIE_WITH_PARENT: str(os.getpid())}
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "stiction_ros.opcua.plant", str(path)],
            stdout=subprocess.PIPE,
            stderr=None,
            text=True,
            env=environment,
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line.startswith("listening"), line

    def stop(self, number: int = signal.SIGTERM) -> int:
        if self.process is None:
            return 0
        self.process.send_signal(number)
        code = self.process.wait(BUDGET)
        assert self.process.stdout is not None
        self.process.stdout.close()
        self.process = None
        return code

    def events(self, kind: str = "") -> list[dict[str, Any]]:
        text = self.journal.read_text(encoding="utf-8") if self.journal.exists() else ""
        found = [json.loads(line) for line in text.splitlines(keepends=True) if line[-1] == "\n"]
        return [one for one in found if not kind or one["event"] == kind]

    def write(self, name: str, value: Any, user: str) -> None:
        """Write one tag as ``user``; raises what the server answers."""

        async def run() -> None:
            client = await open_client(self.url, self.credentials(user))
            try:
                tag = f"nsu={NAMESPACE};s={name}"
                node = client.get_node((await node_ids(client, [tag]))[tag])
                kind = await node.read_data_type_as_variant_type()
                await node.write_value(ua.DataValue(ua.Variant(value, kind)))
            finally:
                await client.disconnect()

        asyncio.run(run())

    def grant(self, mode: str = "ROUT") -> None:
        """Let the operator choose a mode."""
        self.write("LOOP.TARGET", mode, "operator")

    def disturb(self, name: str, value: float) -> None:
        """Put a fault into the server."""
        self.write(f"FAULT.{name}", float(value), "tester")
