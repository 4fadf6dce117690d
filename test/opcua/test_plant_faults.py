"""Faults between bridge and plant: a real server in a process, real sessions, no mocks.

After each of them: no OP was taken without a grant, none beyond limits or rate, OP stepped by
less than 1 % at each transfer of control, and the plant's own controllers have the valves. That
they have them within the time of the watchdog is shown in test_control_system.py, by a clock of
the test.
"""

import asyncio
import datetime
import signal
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bridge_runner import BridgeProcess, BridgeRunner
from plant_process import BUDGET, PlantProcess, wait_until

from stiction_ros.cli.main import main
from stiction_ros.opcua import session
from stiction_ros.opcua.grant import GrantState
from stiction_ros.opcua.loop_bridge import WriteOrder
from stiction_ros.opcua.plant_link import OpcuaNodeSettings, PlantLink, Written
from stiction_ros.opcua.security import fingerprint, load_certificate
from stiction_ros.opcua.session import open_client
from stiction_ros.opcua.tag_map import Use
from stiction_studies.faults.bridge.relay import Relay

pytestmark = pytest.mark.alone

WATCHDOG = 1.5  # s
RATE = 0.1 * 60.0  # % a sample, as the tag map says
SMOOTH = 1.0  # %
TAKEN = 4  # OPs before a fault: enough to move OP by more than 1 %
STILL = {"set_points": None}  # a move of a set-point moves OP as well


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PlantProcess]:
    process = PlantProcess(tmp_path_factory.mktemp("faulty") / "plant", watchdog=WATCHDOG, **STILL)
    process.start()
    yield process
    process.stop()


class Trial:
    """A bridge on the plant, and what the plant has noted since the trial began."""

    def __init__(self, plant: PlantProcess) -> None:
        self.plant = plant
        self.begun = len(plant.events())
        self.runners: list[BridgeRunner] = []

    def bridge(self, url: str = "", **options: Any) -> BridgeRunner:
        credentials = options.pop("credentials", self.plant.credentials())
        url = url or self.plant.url
        runner = BridgeRunner(
            str(self.plant.map_file), url, credentials, speed=self.plant.speed, **options
        )
        runner.start()
        self.runners.append(runner)
        return runner

    def granted(self, url: str = "", **options: Any) -> BridgeRunner:
        runner = self.bridge(url, **options)
        wait_until(lambda: runner.bridge.counts["beat_written"], "the request and a beat")
        self.plant.grant()
        wait_until(lambda: len(self.ops()) > TAKEN, "OPs that are taken")
        return runner

    def events(self) -> list[dict[str, Any]]:
        return self.plant.events()[self.begun :]

    def ops(self) -> list[dict[str, Any]]:
        return [one for one in self.events() if one["event"] == "op"]

    def automatic(self) -> dict[str, Any] | None:
        modes = [one for one in self.events() if one["event"] == "mode"]
        return modes[-1] if modes and modes[-1]["mode"] == "AUTO" else None

    def taken_over(self) -> dict[str, Any]:
        """Wait until the plant has taken over, and return how."""
        return dict(wait_until(self.automatic, "the plant to take over"))

    def close(self) -> None:
        for runner in self.runners:
            runner.stop()
        for name in ("QUALITY", "PAST", "ALIVE", "DELAY", "BURST"):
            if name in self.disturbed:
                self.plant.disturb(name, 0.0)
        if self.plant.running:
            wait_until(lambda: self.plant.events("mode")[-1]["mode"] == "AUTO", "automatic")

    disturbed: tuple[str, ...] = ()

    def disturb(self, name: str, value: float) -> None:
        self.disturbed += (name,)
        self.plant.disturb(name, value)

    def judge(self, refused: int = 0) -> None:
        """Hold what the plant has noted against the rules."""
        mode, last, moved = "AUTO", None, 0
        before: tuple[Any, str] | None = None  # OP in force, and the mode that it was of
        counts: Counter[str] = Counter()
        for one in self.events():
            counts[one["event"]] += 1
            if one["event"] == "mode":
                mode, last = one["mode"], None
            elif one["event"] == "op":
                op = np.array(one["op"])
                assert one["taken"]
                assert mode == "ROUT"
                assert (op >= 0.0).all()
                assert (op <= 100.0).all()
                if last is not None:
                    assert np.abs(op - last).max() <= RATE + 1e-6
                    moved += bool(np.abs(op - last).max() > 1.0)
                elif before is not None:  # the first one of a grant
                    assert np.abs(op - before[0]).max() <= SMOOTH
                last = op
            elif one["event"] == "out":
                out = np.array(one["out"])
                if before is not None and one["mode"] != before[1]:
                    assert np.abs(out - before[0]).max() <= SMOOTH
                before = out, one["mode"]
        assert counts["refused"] <= refused
        assert counts["denied"] == 0
        assert moved or not counts["op"]


@pytest.fixture
def trial(plant: PlantProcess) -> Iterator[Trial]:
    found = Trial(plant)
    yield found
    found.close()


def test_mode_taken_back_in_mid_move(trial: Trial) -> None:
    runner = trial.granted()
    trial.plant.grant("AUTO")
    wait_until(lambda: runner.state is GrantState.IDLE, "the end of the grant")
    count = len(trial.ops())
    heard = len(runner.samples)
    wait_until(lambda: len(runner.samples) > heard + 5, "further samples")
    assert len(trial.ops()) == count
    trial.judge(refused=1)


def test_bad_quality(trial: Trial) -> None:
    runner = trial.granted()
    trial.disturb("QUALITY", 1.0)
    assert trial.taken_over()["alarm"] == "request taken back"
    assert runner.bridge.grant.reason == "PV of bad quality"
    assert np.isnan(runner.samples[-1].pv).all()
    trial.judge()


@pytest.mark.trial
def test_stamps_in_the_past(trial: Trial) -> None:
    runner = trial.granted()
    trial.disturb("PAST", 86_400.0)
    trial.taken_over()
    assert runner.bridge.grant.reason == "PV of bad quality"
    assert np.isnan(runner.samples[-1].pv).all()
    wait_until(lambda: runner.bridge.sampler.counts["new_runs"], "their being believed")
    trial.judge()


def test_the_plants_heartbeat_stands_still(trial: Trial) -> None:
    runner = trial.granted()
    trial.disturb("ALIVE", 1.0)
    trial.taken_over()
    assert runner.bridge.grant.reason == "the plant's heartbeat stands still"
    trial.judge()


def test_the_controller_is_gone(trial: Trial) -> None:
    runner = trial.granted()
    runner.commands = False
    trial.taken_over()
    assert runner.bridge.grant.reason.startswith("no op from")
    trial.judge()


@pytest.mark.trial
def test_a_thousand_changes_a_second(trial: Trial) -> None:
    runner = trial.granted()
    trial.disturb("BURST", 50.0)  # of two tags, ten times a second
    heard = len(runner.samples)
    wait_until(lambda: len(runner.samples) > heard + 15, "samples")
    assert runner.state is GrantState.GRANTED
    steps = np.diff([sample.stamp for sample in runner.samples])
    assert np.abs(steps[heard:] - 60_000_000_000).max() < 6_000_000_000
    trial.judge()


@pytest.mark.trial
def test_a_server_that_is_slow_by_two_seconds(trial: Trial) -> None:
    runner = trial.granted()
    trial.disturb("DELAY", 2.0)
    trial.taken_over()
    wait_until(lambda: runner.state is GrantState.IDLE, "the end of the grant")
    trial.judge(refused=1)


@pytest.mark.trial
def test_the_connection_is_cut_and_comes_back(trial: Trial) -> None:
    relay = Relay(trial.plant.port)
    try:
        runner = trial.granted(f"opc.tcp://127.0.0.1:{relay.port}/plant")
        relay.cut()
        assert trial.taken_over()["alarm"].startswith("watchdog")
        wait_until(lambda: runner.state is GrantState.IDLE, "the end of the grant")
        wait_until(lambda: np.isnan(runner.samples[-1].pv).all(), "samples without values")
        count = len(trial.ops())
        relay.mend()
        wait_until(lambda: np.isfinite(runner.samples[-1].pv).all(), "samples again")
        assert runner.state is GrantState.IDLE
        assert len(trial.ops()) == count
        assert runner.bridge.ask() == ""
        beats = runner.bridge.counts["beat_written"]
        wait_until(lambda: runner.bridge.counts["beat_written"] > beats, "a new request")
        trial.plant.grant()
        wait_until(lambda: len(trial.ops()) > count + 5, "OPs again")
        runner.stop()
        trial.runners.clear()
    finally:
        relay.close()
    trial.judge()


def test_the_bridge_is_killed(trial: Trial) -> None:
    plant = trial.plant
    process = BridgeProcess(plant.folder, **process_settings(plant, 21))
    try:
        process.wait_for("asked")

        def granted() -> bool:  # as soon as a beat has come
            plant.grant()
            return bool(plant.events("target")[-1]["why_not"] == "")

        wait_until(granted, "the grant", pause=0.1)
        wait_until(lambda: len(trial.ops()) > TAKEN, "OPs that are taken")
        process.stop(signal.SIGKILL)
        assert trial.taken_over()["alarm"].startswith("watchdog")
    finally:
        process.stop(signal.SIGKILL)
    trial.judge()


def process_settings(plant: PlantProcess, identity: int) -> dict[str, Any]:
    told = plant.credentials()
    return {
        "map_file": str(plant.map_file),
        "url": plant.url,
        "speed": plant.speed,
        "identity": identity,
        "credentials": {
            "certificate": told.certificate,
            "private_key": told.private_key,
            "server_certificate": told.server_certificate,
            "user": told.user,
            "password_file": told.password_file,
        },
    }


def test_two_bridges_for_one_tag(trial: Trial) -> None:
    first = trial.granted(identity=7)
    second = trial.bridge(identity=8)
    wait_until(lambda: "another" in second.bridge.grant.reason, "the second to see the first")
    heard = len(second.samples)
    wait_until(lambda: len(second.samples) > heard + 10, "samples of the second")
    assert second.state is GrantState.IDLE
    assert first.state is GrantState.GRANTED
    assert second.bridge.counts == Counter()
    trial.judge()


def test_a_user_without_rights(trial: Trial) -> None:
    runner = trial.bridge(credentials=trial.plant.credentials("reader"))
    wait_until(lambda: "BadUserAccessDenied" in runner.bridge.grant.reason, "the refusal")
    assert runner.samples
    assert trial.ops() == []


@pytest.mark.parametrize(
    "kind",
    [
        "server",
        "expired",
        *(pytest.param(k, marks=pytest.mark.trial) for k in ("stranger", "word")),
    ],
)
def test_what_cannot_be_trusted_gets_no_session(
    trial: Trial, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "ANSWER", 2.0)  # the server does not answer another's key
    plant = trial.plant
    changes = {}
    if kind == "server":  # another server than the pinned one
        plant.certificate("other_server", server=True)
        changes["server_certificate"] = str(plant.secrets / "other_server.der")
    elif kind in ("stranger", "expired"):
        ago = datetime.timedelta(days=10 if kind == "expired" else 1)
        plant.certificate(kind, begin=datetime.datetime.now(datetime.UTC) - ago, days=5)
        changes["certificate"] = str(plant.secrets / f"{kind}.der")
        changes["private_key"] = str(plant.secrets / f"{kind}.pem")
    else:
        changes["password_file"] = plant.word("tester")
    runner = trial.bridge(credentials=plant.credentials(**changes))
    wait_until(lambda: runner.links, "a refusal")
    assert not any(link.connected for link in runner.links)
    said = {"server": "is not what the server shows now", "expired": "has expired"}
    assert said.get(kind, "") in runner.links[0].reason != ""
    assert runner.samples == []
    words = [plant.password_file(user).read_text() for user in plant.users]
    assert not any(word in link.reason for link in runner.links for word in words)


def test_a_connection_that_is_closed_at_once_is_not_waited_for(
    plant: PlantProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "ANSWER", 3600.0)  # whoever waits for it waits in vain
    relay = Relay(plant.port)
    try:
        relay.cut()
        for _ in range(3):
            opening = open_client(f"opc.tcp://127.0.0.1:{relay.port}/plant", plant.credentials())
            with pytest.raises(OSError, match=r"closes|reset|refused"):
                asyncio.run(asyncio.wait_for(opening, BUDGET))
    finally:
        relay.close()


def test_a_request_goes_before_what_its_loop_waits_to_write() -> None:
    link = PlantLink(OpcuaNodeSettings(url="opc.tcp://127.0.0.1:1", security="none"), (), {})

    def order(loop: str, kind: Use) -> WriteOrder:
        return WriteOrder(loop, kind, (("s=X", 0.0),), 1e9)

    for loop, kind in (("A", Use.BEAT), ("B", Use.BEAT), ("A", Use.OP)):
        link._put(order(loop, kind))
    link._put(order("A", Use.REQUEST))
    link._put(order("A", Use.REQUEST))  # one request does not drop another
    left = [link._orders.get_nowait() for _ in range(link._orders.qsize())]
    assert [(one.loop, one.kind) for one in left] == [
        ("B", Use.BEAT),
        ("A", Use.REQUEST),
        ("A", Use.REQUEST),
    ]
    told = [event for event in link.drain() if isinstance(event, Written)]
    assert [event.order.kind for event in told] == [Use.BEAT, Use.OP]
    assert all(event.failure for event in told)


@pytest.mark.trial
def test_the_server_is_killed_and_starts_again(trial: Trial) -> None:
    plant = trial.plant
    runner = trial.granted()
    plant.stop(signal.SIGKILL)
    wait_until(lambda: runner.state is GrantState.IDLE, "the end of the grant")
    count = len(trial.ops())
    wait_until(lambda: np.isnan(runner.samples[-1].pv).all(), "samples without values")
    plant.start()
    wait_until(lambda: np.isfinite(runner.samples[-1].pv).all(), "samples again")
    assert runner.state is GrantState.IDLE
    assert len(trial.ops()) == count
    assert plant.events("mode")[-1]["mode"] == "AUTO"


def test_the_servers_certificate_is_pinned_by_its_fingerprint(
    plant: PlantProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "pinned.der"
    shown = fingerprint(load_certificate(plant.secrets / "server.der"))
    assert main(["certificates", "pin", plant.url]) == 0
    assert shown in capsys.readouterr().out
    wrong = shown.replace(shown[:2], "00" if shown[:2] != "00" else "11", 1)
    assert (
        main(["certificates", "pin", plant.url, "--to", str(target), "--fingerprint", wrong]) == 2
    )
    assert not target.exists()
    assert (
        main(["certificates", "pin", plant.url, "--to", str(target), "--fingerprint", shown]) == 0
    )
    assert target.read_bytes() == (plant.secrets / "server.der").read_bytes()
    assert main(["certificates", "pin", "opc.tcp://127.0.0.1:1"]) == 2
    assert "nobody listens at that address" in capsys.readouterr().err
