"""A bridged loop that faults are put into: plant, relay, bridge, controller, recorder."""

import datetime
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stiction_ros.cli.shared.scenarios import find, node_parameters
from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel
from stiction_studies.control_system.control_system import AUTO, REMOTE
from stiction_studies.control_system.journal import Allowed, Written, written
from stiction_studies.control_system.process import PlantOptions, PlantProcess
from stiction_studies.faults.bridge.relay import Relay
from stiction_studies.faults.loop.faulted import LOOK, FaultedLoop
from stiction_studies.faults.loop.node_process import NodeProcess

SPEED = 600.0  # ten samples a second
WATCHDOG = 5.0  # s
RATE = 0.05  # % per s of the plant: 3 % a sample, so that the kicks of embedding meet it
LIMITS = (35.0, 65.0)  # %
FRICTION = {"effect": "stiction", "law": "he", "f_s": 8.0, "f_d": 1.0}  # of V1, as it is
SET_POINTS: dict[str, Any] = {  # a move every two seconds: OP never rests
    "repeat": 2400.0,
    "moves": [{"time": 0.0, "C": 7.5, "T": 42.324}, {"time": 1200.0, "C": 7.58, "T": 43.0}],
}
STARTED = ("recorder", "controller", "opcua")
ENDED = ("opcua", "controller", "recorder")
HEARD = ("pv", "op", "op_applied")
SCANS = 3  # of the plant under its own controllers, before control is asked for again
START = 90.0  # s until the first samples
SOON = 20.0  # s for what must happen
REST = 60.0  # s in which PV comes to rest, before the first move of a valve test
STATUS = "opcua: loop tank"
LEAST = 0.5  # %: of a move of a valve test
TEST = "valve_test"  # mode of the controller
REACH = {"valve_test_op": 20.0, "valve_test_pv": 1.0, "valve_test_output": "C"}
SECRETS = {  # parameters of the bridge, and its own copies of the files
    "certificate": "client.der",
    "private_key": "client.pem",
    "server_certificate": "server.der",
    "password_file": "password",
}


class NotSeenError(Exception):
    """What a case waits for did not come; it ends there."""


class BridgedLoop(FaultedLoop):
    """The loop of one case, as the functions of the catalogue see it."""

    def __init__(self, directory: Path, seed: int, rests: bool = False) -> None:
        """Make certificates, accounts and parameters, and join the domain."""
        from stiction_studies.faults.loop.fault_probe import Probe

        super().__init__(directory)
        self.limited = 0
        schedule = directory / "moves.set_points.yaml"
        moves = {**SET_POINTS, "moves": SET_POINTS["moves"][:1]} if rests else SET_POINTS
        schedule.write_text(yaml.safe_dump(moves), encoding="utf-8")
        options = PlantOptions(SPEED, WATCHDOG, RATE, LIMITS, seed, set_points=str(schedule))
        self.plant = PlantProcess(directory / "plant", options)
        self.period = self.plant.model.sample_time / SPEED
        self.relay = Relay(self.plant.port)
        self._own = directory / "bridge"  # what the bridge is given, so that it can be changed
        self._own.mkdir()
        self.nodes = {
            name: NodeProcess(name, values, directory, self.environment)
            for name, values in self._parameters().items()
        }
        self.probe = Probe(self.environment, topics=HEARD)

    def _parameters(self) -> dict[str, dict[str, Any]]:
        nodes = node_parameters(find("tank"), self.directory)
        told = LoopModel.load(find_config("tank_linear.loop.yaml")).to_mapping()
        told["valves"][0]["effects"] = [FRICTION]
        model = self.directory / "known.loop.yaml"
        model.write_text(yaml.safe_dump(told), encoding="utf-8")
        nodes["controller"].update(
            pace="realtime",
            speed=SPEED,
            mode="embedding",
            model=str(model.resolve()),
            wait_for=["opcua", "recorder"],
        )
        nodes["opcua"] = self.plant.node_parameters() | {
            "url": f"opc.tcp://127.0.0.1:{self.relay.port}/plant",
            "write": ["tank"],
            "wait_for": ["controller", "recorder"],
        }
        for key in SECRETS:
            self.give(key)
            nodes["opcua"][key] = str(self._file(key).resolve())
        return {name: nodes[name] for name in STARTED}

    # ---- processes -------------------------------------------------------------------------

    def start(self) -> None:
        """Start server and nodes, and wait for samples; then control is granted."""
        self.plant.start()
        for name in STARTED:
            self.nodes[name].start()
        self._must(lambda: len(self.probe.heard["pv"]) >= 10, "ten samples", START)
        self.obtain()
        self._must(lambda: self.taken >= 30, "OPs that are taken")
        self.limited = self._limited

    def stop(self) -> None:
        """End everything."""
        self.end_nodes(ENDED)
        self.plant.stop()
        self.relay.close()
        self.probe.close()

    def kill(self, name: str) -> None:
        """Kill a node."""
        self.nodes[name].kill()

    def second_bridge(self) -> None:
        """Start another bridge for the same tags, in a namespace of its own; it asks at once."""
        values = self._parameters()["opcua"] | {
            "wait_for": [],
            "ask": "start",
            "commander": "/controller",
        }
        folder = self.directory / "beside"
        folder.mkdir()
        remaps = ["-r", "__ns:=/second", "-r", "op:=/op"]
        process = NodeProcess("opcua", values, folder, self.environment, remaps)
        process.start()
        self._beside.append(process)
        told = self.probe.values
        self._must(
            lambda: told.get("second/opcua: status", {}).get("connected") == "True",
            "the session of the second bridge",
        )

    # ---- what the bridge is given ----------------------------------------------------------

    def give(self, key: str, file: Path | None = None) -> None:
        """Put another file in the place of one of :data:`SECRETS`; None for the right one."""
        right = Path(getattr(self.plant.credentials(), key))
        shutil.copy2(file or right, self._file(key))

    def _file(self, key: str) -> Path:
        return self._own / SECRETS[key]

    def certificate(self, name: str, *, server: bool = False, expired: bool = False) -> Path:
        """Make a certificate that nobody has trusted, and return its file without suffix."""
        ago = datetime.timedelta(days=10 if expired else 0, hours=1)
        begin = datetime.datetime.now(datetime.UTC).replace(microsecond=0) - ago
        self.plant.certificate(name, server=server, begin=begin, days=5)
        return self.plant.secrets / name

    def reconnect(self) -> None:
        """Let the bridge lose its session, so that it opens another one."""
        self.relay.cut()
        self.wait_until(lambda: not self.granted, SOON)
        self.relay.mend()

    # ---- control ---------------------------------------------------------------------------

    def obtain(self) -> None:
        """Ask for control by the service, and let the operator grant it."""
        self._must(self._calm, "samples with values, and an idle bridge")
        answer = self.probe.trigger("ask_grant")
        if not answer.startswith("asked"):
            self.remark(f"ask_grant answers {answer or 'nothing'}")
        # A grant before the request has reached the plant is one that nobody has asked for.
        self.wait_until(lambda: self._status in ("asked", "granted"), SOON)
        end = time.monotonic() + SOON
        count = self.taken
        while self.mode != REMOTE and time.monotonic() < end:
            self.plant.grant()
            time.sleep(5 * LOOK)
        self._must(lambda: self.taken >= count + 5, "OPs after the operator's grant")

    def take_back(self) -> None:
        """Let the operator take control, and see the bridge idle and samples going on."""
        self.plant.grant(AUTO)
        self._must(lambda: not self.granted, "the bridge to be idle")
        self.wait_samples(10)

    def _calm(self) -> bool:
        heard = self.probe.heard["pv"]
        told = self._status == "idle"
        fresh = bool(heard) and time.monotonic() - heard[-1].wall < 10 * self.period
        finite = fresh and bool(np.isfinite(heard[-1].values).all())
        return told and finite and self.mode == AUTO and self._scans() >= SCANS

    def _scans(self) -> int:
        """Return the scans of the plant since its mode changed last."""
        events = [one["event"] for one in self.plant.events()]
        last = max((k for k, event in enumerate(events) if event == "mode"), default=0)
        return events[last:].count("out")

    @property
    def granted(self) -> bool:
        """Whether the bridge says that control is granted."""
        return self._status == "granted"

    @property
    def _status(self) -> str:
        return str(self.probe.values.get(STATUS, {}).get("grant", ""))

    @property
    def mode(self) -> str:
        """Mode of the plant's controllers."""
        modes = self.plant.events("mode")
        return str(modes[-1]["mode"]) if modes else AUTO

    @property
    def _limited(self) -> int:
        """Number of OPs that limits or rate have changed."""
        return int(self.probe.values.get(STATUS, {}).get("op_limited", 0))

    @property
    def taken(self) -> int:
        """Number of remote OPs that the plant has taken."""
        return len(self.plant.events("op"))

    def written(self) -> Written:
        """Return what the plant has noted of what was written."""
        low, high = LIMITS
        allowed = Allowed(low, high, RATE, self.plant.model.sample_time, SPEED)
        return written(self.plant.events(), allowed)

    def moving(self) -> None:
        """Wait until OP is on its way: the controller wants another one than is in force."""
        applied, wanted = self.probe.heard["op_applied"], self.probe.heard["op"]

        def far() -> bool:
            if not applied or not wanted:
                return False
            away = np.array(wanted[-1].values) - np.array(applied[-1].values)
            return float(np.abs(away).max()) > 2 * RATE * self.plant.model.sample_time

        self._must(far, "a move of OP")

    def test_valve(self) -> None:
        """Let the controller test a valve, and wait until OP has moved for it."""
        self.probe.set_parameters("controller", {"mode": TEST, **REACH})
        self._must(lambda: self.probe.known.mode == TEST, "a valve test")
        heard, since = self.probe.heard["op"], self.probe.known.since

        def moved() -> bool:
            ours = [one.values for one in heard if one.stamp >= since]
            return len(ours) > 1 and abs(ours[-1][0] - ours[0][0]) > LEAST

        self._must(moved, "a move of the test", REST)
        self._must(lambda: self._limited, "a move at the rate", REST)
        self.limited = self._limited

    # ---- time ------------------------------------------------------------------------------

    def wait_samples(self, count: int) -> None:
        """Wait until ``count`` more samples have come."""
        heard = self.probe.heard["pv"]
        have = len(heard)
        self._must(lambda: len(heard) >= have + count, f"{count} samples")

    def _must(self, condition: Callable[[], object], what: str, seconds: float = SOON) -> None:
        if not self.wait_until(condition, seconds):
            raise NotSeenError(f"{what} not seen within {seconds:g} s")
