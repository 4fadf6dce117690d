"""``stiction demo opcua``: the tank behind a control system, under the operator's grant."""

from __future__ import annotations

import asyncio
import os
import secrets
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from stiction_ros.cli.node_processes import NodeError, NodeProcesses
from stiction_ros.cli.progress import Bar
from stiction_ros.cli.scenarios import find, node_parameters
from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel
from stiction_ros.opcua import require_asyncua
from stiction_ros.orphans import DIE_WITH_PARENT

if TYPE_CHECKING:
    from asyncua import Client

NAME = "opcua"
SPEED = 600.0  # simulated seconds per second: ten samples, two encrypted calls for each OP
PI = ({"gain": 40.0, "integral_time": 900.0}, {"gain": 3.0, "integral_time": 600.0})
RATE = 0.25  # % per s of the plant: 15 % a sample, as the kicks against 8 % of stiction need
WATCHDOG = 5.0  # s
PUBLISHING = 0.02  # s
ROUND = 620  # samples of a round of the set-points
GRANTED = ROUND + 560  # in the last hold of the second round
LATEST = 3 * ROUND  # when the friction must have been found
HOLD = 80  # samples into a round: within a hold, where no move of a set-point moves OP
WATCHED = 186  # samples for which the plant's PIs are watched afterwards
SILENCE = 60.0  # s without a scan after which the run is given up
READY = 60.0  # s for the server to start
ACCOUNTS = {"bridge": ["remote"], "operator": ["operation"]}


def require() -> None:
    """Raise InputError when what the demonstration needs is not installed."""
    require_asyncua()


def run(directory: Path, seed: int | None, speed: float | None, show: Bar) -> bool:
    """Run it into an empty ``directory`` and print what came of it; return whether it is good."""
    from stiction_ros.report.opcua_report import report_opcua

    speed = SPEED if speed is None else speed
    plant = _Plant(directory, seed or 1, speed)
    processes = NodeProcesses(_nodes(directory, plant, speed), directory)
    begin = time.monotonic()
    try:
        try:
            plant.start()
            processes.start()
            asyncio.run(_operate(plant, processes, show))
        finally:
            processes.stop()
            plant.stop()
        processes.check()
    except NodeError as failure:
        print(f"stiction: {NAME}: {failure}; see {directory / 'log'}", file=sys.stderr)
        return False
    show(0.95, f"{NAME}: reporting")
    summary = report_opcua(directory / "bag", directory, ROUND, time.monotonic() - begin)
    show(1.0)
    for line in summary["story"]:
        print(f"{NAME}: {line}")
    print(directory / "report.html")
    return bool(summary["status"] == "ok")


class _Plant:
    """The simulated plant and its control system, in a process of its own."""

    def __init__(self, directory: Path, seed: int, speed: float) -> None:
        """Make certificates, passwords and tag map below ``directory``."""
        import datetime

        from stiction_ros.opcua.plant.tags import SERVER_URI, tag_map_of
        from stiction_ros.opcua.security import (
            CLIENT_URI,
            Credentials,
            Identity,
            make_certificate,
            write_secret,
        )

        folder = directory / "secrets"
        (folder / "trusted").mkdir(mode=0o700, parents=True)
        now = datetime.datetime.now(datetime.UTC).replace(microsecond=0)
        hosts = ("127.0.0.1",)
        own, trusted = folder / "client.pem", folder / "trusted" / "client.der"
        make_certificate(Identity(CLIENT_URI, hosts, False, now, 1), trusted, own)
        server = folder / "server.der"
        make_certificate(Identity(SERVER_URI, hosts, True, now, 1), server, folder / "server.pem")
        words = {name: secrets.token_urlsafe(24) for name in ACCOUNTS}
        for name, word in words.items():
            write_secret(folder / f"{name}.password", word.encode())
        port = _free_port()
        self.url = f"opc.tcp://127.0.0.1:{port}/plant"
        self.credentials = {
            name: Credentials(
                certificate=str(trusted),
                private_key=str(own),
                server_certificate=str(server),
                user=name,
                password_file=str(folder / f"{name}.password"),
            )
            for name in ACCOUNTS
        }
        model_file = find_config("tank.loop.yaml")
        model = LoopModel.load(model_file)
        self.map_file = directory / "tank.tags.yaml"
        told = tag_map_of(model, self.url, RATE, WATCHDOG)
        self.map_file.write_text(yaml.safe_dump(told, sort_keys=False), encoding="utf-8")
        self._log = directory / "log" / "plant.log"
        self._file = folder / "plant.yaml"
        settings: dict[str, Any] = {
            "model": str(model_file),
            "set_points": str(find_config("tank.set_points.yaml")),
            "pi": list(PI),
            "watchdog": WATCHDOG,
            "accounts": [
                {"name": name, "password": words[name], "writes": rights}
                for name, rights in ACCOUNTS.items()
            ],
            "port": port,
            "certificate": str(server),
            "private_key": str(folder / "server.pem"),
            "trusted": str(folder / "trusted"),
            "speed": speed,
            "start": int(now.timestamp()) * 1_000_000_000,
            "seed": seed,
            "journal": str(directory / "journal.jsonl"),
        }
        write_secret(self._file, yaml.safe_dump(settings).encode())
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the server and wait until it listens."""
        self._log.parent.mkdir(exist_ok=True)
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "stiction_ros.opcua.plant", str(self._file)],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, DIE_WITH_PARENT: str(os.getpid())},
                start_new_session=True,
            )
        end = time.monotonic() + READY
        while b"listening" not in self._log.read_bytes():
            self.require_running()
            if time.monotonic() > end:
                raise NodeError("the plant's server does not start")
            time.sleep(0.05)

    def require_running(self) -> None:
        """Raise NodeError when the server has ended."""
        if self._process is not None and self._process.poll() is not None:
            raise NodeError(f"the plant ended with code {self._process.returncode}")

    def stop(self) -> None:
        """End the server."""
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(READY)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()


def _nodes(directory: Path, plant: _Plant, speed: float) -> dict[str, dict[str, Any]]:
    """Return the parameters of the four nodes: those of the scenario tank, and the bridge."""
    nodes = node_parameters(find("tank"), directory)
    del nodes["plant"]
    partners = ("controller", "estimator", "recorder")
    for name in ("controller", "estimator"):
        others = [other for other in ("opcua", *partners) if other != name]
        nodes[name].update(pace="realtime", speed=speed, wait_for=others)
    told = plant.credentials["bridge"]
    nodes["opcua"] = {
        "tags": str(plant.map_file.resolve()),
        "certificate": str(Path(told.certificate).resolve()),
        "private_key": str(Path(told.private_key).resolve()),
        "server_certificate": str(Path(told.server_certificate).resolve()),
        "user": told.user,
        "password_file": str(Path(told.password_file).resolve()),
        "publishing": PUBLISHING,
        "write": ["tank"],
        "ask": "start",
        "speed": speed,
        "wait_for": list(partners),
    }
    return nodes


async def _operate(plant: _Plant, processes: NodeProcesses, show: Bar) -> None:
    """Play the operator: grant it once the friction is found, take it back, watch the PIs."""
    from asyncua import ua

    from stiction_ros.opcua.session import describe, open_client

    client = await open_client(plant.url, plant.credentials["operator"])
    try:
        operator = _Operator(client, plant, processes, show)
        await operator.prepare()
        found = await operator.until(GRANTED, "the plant's PIs cycle", operator.identified)
        await operator.choose("ROUT")
        end = -(-found // ROUND) * ROUND + ROUND + HOLD
        await operator.until(end, "the operator has granted it")
        await operator.choose("AUTO")
        await operator.until(end + WATCHED, "the operator has taken it back")
    except (ua.UaError, OSError, TimeoutError) as error:
        raise NodeError(f"the operator's session was lost: {describe(error)}") from None
    finally:
        await client.disconnect()


class _Operator:
    """Sees the plant's scans and the controller's log, and chooses the mode."""

    def __init__(self, client: Client, plant: _Plant, processes: NodeProcesses, show: Bar) -> None:
        self._client, self._plant = client, plant
        self._processes, self._show = processes, show

    async def prepare(self) -> None:
        """Find the tags."""
        from stiction_ros.opcua.plant.tags import NAMESPACE
        from stiction_ros.opcua.session import node_ids

        tags = [f"nsu={NAMESPACE};s={name}" for name in ("LOOP.ALIVE", "LOOP.TARGET")]
        found = await node_ids(self._client, tags)
        self._scans, self._target = (self._client.get_node(found[tag]) for tag in tags)

    def identified(self) -> bool:
        """Return whether the controller works with a friction that was found."""
        log = self._processes.directory / "log" / "controller.log"
        text = log.read_text(encoding="utf-8") if log.exists() else ""
        return ": embedding, " in text or ": inversion, " in text

    async def until(self, scan: int, what: str, also: Any = None) -> int:
        """Wait for a scan, and for ``also``; return the scan that it has come to.

        Raises:
            NodeError: a process has ended, nothing moves, or ``also`` never comes.
        """
        last, moved = -1, time.monotonic()
        while True:
            self._plant.require_running()
            self._processes.require_running()
            now = int(await self._scans.read_value())
            if now != last:
                last, moved = now, time.monotonic()
            if now >= scan and (also is None or also()):
                return now
            if also is not None and now > LATEST:
                raise NodeError(f"no friction was found in {LATEST} samples")
            if time.monotonic() - moved > SILENCE:
                raise NodeError(f"the plant stands still at scan {now}")
            share = now / (3 * ROUND + HOLD + WATCHED)
            self._show(min(0.94, share), f"{NAME}: {what}")
            await asyncio.sleep(0.2)

    async def choose(self, mode: str) -> None:
        """Choose a mode for the plant's controllers."""
        from asyncua import ua

        value = ua.DataValue(ua.Variant(mode, ua.VariantType.String))
        await self._target.write_value(value)


def _free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])
