"""The faults between a control system and its bridge, and the table of them."""

import signal
import time
from collections.abc import Callable

import numpy as np

from stiction_studies.faults.bridge.bridge_fault import BridgeFault
from stiction_studies.faults.bridge.bridged_loop import WATCHDOG, BridgedLoop
from stiction_studies.faults.named import named

AWAY = 1.0  # s
DAY = 86_400.0  # s
SLOW = 2.0  # s
EXTRA = 50  # changes of each of two PVs in each of ten samples a second
SLOW_TO_TELL = 15.0  # s: a server that is spoken to by another key does not answer
LONG = 3.0  # s for which the loop is looked at where nothing is to happen

Act = Callable[[BridgedLoop], None]


def cut(loop: BridgedLoop) -> None:
    """Cut the connection for a while."""
    loop.relay.cut()
    time.sleep(AWAY)


def server_killed(loop: BridgedLoop) -> None:
    """Kill the server and start it again; its controllers go on from their last OP."""
    loop.plant.stop(signal.SIGKILL)
    time.sleep(AWAY)
    loop.plant.start()


def other_server(loop: BridgedLoop) -> None:
    """Pin another certificate than the server's."""
    stranger = loop.certificate("other_server", server=True)
    loop.begins()
    loop.give("server_certificate", stranger.with_suffix(".der"))
    loop.reconnect()


def another_certificate(expired: bool) -> Act:
    """Return what gives the bridge a certificate that is not trusted, or was once."""

    def put(loop: BridgedLoop) -> None:
        made = loop.certificate("another", expired=expired)
        loop.begins()
        loop.give("certificate", made.with_suffix(".der"))
        loop.give("private_key", made.with_suffix(".pem"))
        loop.reconnect()

    return put


def wrong_password(loop: BridgedLoop) -> None:
    """Give the bridge another user's password."""
    loop.give("password_file", loop.plant.password_file("tester"))
    loop.reconnect()


def right_files(loop: BridgedLoop) -> None:
    """Give the bridge what it needs."""
    for key in ("certificate", "private_key", "server_certificate", "password_file"):
        loop.give(key)


def disturb(name: str, value: float) -> Act:
    """Return what puts a fault into the server."""

    def put(loop: BridgedLoop) -> None:
        loop.plant.disturb(name, value)

    return put


def take_back_in_mid_move(loop: BridgedLoop) -> None:
    """Let the operator choose AUTO while OP is on its way."""
    loop.moving()
    loop.begins()
    loop.plant.grant("AUTO")


def in_a_valve_test(act: Act) -> Act:
    """Return what ends a valve test, after which the former mode waits and nothing is written."""

    def put(loop: BridgedLoop) -> None:
        former = loop.probe.known.mode
        loop.test_valve()
        loop.begins()
        act(loop)
        if not loop.wait_until(lambda: loop.probe.known.mode == former, LONG):
            loop.remark(f"the mode is {loop.probe.known.mode}, it was {former} before the test")
        taken = loop.taken
        time.sleep(LONG)
        if loop.taken > taken:
            loop.remark(f"{loop.taken - taken} OPs were written after the test had ended")

    return put


def kill(name: str) -> Act:
    """Return what kills a node."""

    def put(loop: BridgedLoop) -> None:
        loop.kill(name)

    return put


def restart(name: str) -> Act:
    """Return what starts a node again."""

    def mend(loop: BridgedLoop) -> None:
        loop.restart(name)

    return mend


def second_bridge(loop: BridgedLoop) -> None:
    """Start a second bridge that wants the same tags."""
    loop.second_bridge()
    loop.begins()
    time.sleep(LONG + 1.0)


def many_changes(loop: BridgedLoop) -> None:
    """Let each PV change a thousand times a second, and see no sample missing."""
    heard = loop.probe.heard["pv"]
    have = len(heard)
    loop.plant.disturb("BURST", EXTRA)
    time.sleep(LONG)
    steps = np.diff([one.stamp for one in heard[have:]]) / 1e9
    wrong = np.abs(steps - loop.plant.model.sample_time) > 0.1 * loop.plant.model.sample_time
    if not len(steps) or wrong.any():
        loop.remark(f"{int(wrong.sum())} of {len(steps)} samples came at other times")


FAULTS: tuple[BridgeFault, ...] = (
    BridgeFault(
        "connection-cut",
        "samples are NaN until it is back; the watchdog takes over, the bridge stays idle",
        cut,
        "the connection was lost",
        lambda loop: loop.relay.mend(),
    ),
    BridgeFault(
        "server-killed",
        "the plant's controllers begin at their last OP; the bridge connects again and stays idle",
        server_killed,
        "the connection was lost",
    ),
    BridgeFault(
        "certificate-of-the-server-wrong",
        "no session with a server that is not the pinned one",
        other_server,
        "is not what the server shows now",
        right_files,
        within=SLOW_TO_TELL,
    ),
    BridgeFault(
        "certificate-not-trusted",
        "the server lets no stranger in",
        another_certificate(expired=False),
        "BadCertificateUntrusted",
        right_files,
    ),
    BridgeFault(
        "certificate-expired",
        "no session is opened",
        another_certificate(expired=True),
        "has expired on",
        right_files,
    ),
    BridgeFault(
        "password-wrong",
        "the server lets nobody in; the password is told nowhere",
        wrong_password,
        "BadUserAccessDenied|BadIdentityTokenRejected",
        right_files,
    ),
    BridgeFault(
        "user-without-rights",
        "nothing more is written, the watchdog takes over",
        disturb("RIGHTS", 1.0),
        "BadUserAccessDenied",
        disturb("RIGHTS", 0.0),
    ),
    BridgeFault(
        "mode-taken-back-in-mid-move",
        "the plant's controllers go on from the OP in force",
        take_back_in_mid_move,
        "taken back by the mode|op not written",
    ),
    BridgeFault(
        "quality-bad",
        "samples are NaN, the request is taken back",
        disturb("QUALITY", 1.0),
        "PV of bad quality",
        disturb("QUALITY", 0.0),
    ),
    BridgeFault(
        "stamps-in-the-past",
        "they are refused and counted, the request is taken back",
        disturb("PAST", DAY),
        "PV of bad quality",
        disturb("PAST", 0.0),
    ),
    BridgeFault(
        "heartbeat-of-the-plant-lost",
        "the request is taken back",
        disturb("ALIVE", 1.0),
        "the plant's heartbeat stands still",
        disturb("ALIVE", 0.0),
        within=WATCHDOG + 1.0,
    ),
    BridgeFault(
        "bridge-killed",
        "our heartbeat stands still, the watchdog takes over; a new bridge is idle",
        kill("opcua"),
        "no pv for",
        restart("opcua"),
        by="controller",
    ),
    BridgeFault(
        "controller-killed",
        "the request is taken back; a new controller goes on from the OP in force",
        kill("controller"),
        "no op from /controller",
        restart("controller"),
    ),
    BridgeFault(
        "two-bridges",
        "the second waits and writes nothing, the first goes on",
        second_bridge,
        "another one lets the heartbeat rise",
        by="second/opcua: loop tank",
        within=LONG,
        taken_over=False,
    ),
    BridgeFault(
        "a-thousand-changes-a-second",
        "no sample is lost, control goes on",
        many_changes,
        "",
        disturb("BURST", 0.0),
        taken_over=False,
    ),
    BridgeFault(
        "server-slow-by-two-seconds",
        "an OP that would come too late is not written, the request is taken back",
        disturb("DELAY", SLOW),
        "the server does not take an OP in time",
        disturb("DELAY", 0.0),
        refused=1,
    ),
    BridgeFault(
        "valve-test-taken-over",
        "the operator ends a valve test; the plant's controllers go on from the OP in force",
        in_a_valve_test(lambda loop: loop.plant.grant("AUTO")),
        "taken back by the mode|op not written",
        rests=True,
    ),
    BridgeFault(
        "valve-test-cut-off",
        "a valve test ends with the connection; nothing more is written",
        in_a_valve_test(lambda loop: loop.relay.cut()),
        "the connection was lost",
        lambda loop: loop.relay.mend(),
        rests=True,
    ),
)


def find(name: str) -> BridgeFault:
    """Return the fault of that name.

    Raises:
        InputError: there is none.
    """
    return named(FAULTS, name, "stiction faults --opcua")


def table() -> str:
    """Return the table of the documentation, in Markdown."""
    rows = ["| fault | expected | the plant takes over |", "|---|---|---|"]
    rows += [
        f"| `{fault.name}` | {fault.expected} | {'yes' if fault.taken_over else 'no'} |"
        for fault in FAULTS
    ]
    return "\n".join(rows) + "\n"
