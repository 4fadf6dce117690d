"""The node ``opcua`` between a real server, in a process of its own, and topics."""

import signal
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")

sys.path.insert(0, str(Path(__file__).parents[1] / "nodes"))
from graph import Graph
from open_sockets import listening_of
from plant_process import BUDGET, USERS, PlantProcess
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from stiction_ros.nodes.opcua import OpcuaNode
from stiction_ros.nodes.shared.managed import LATCHED_QOS, SIGNAL_QOS
from stiction_ros.nodes.shared.messages import joint_state, to_ns
from stiction_ros.opcua.grant import GrantState
from stiction_studies.faults.bridge.relay import Relay

OPS = (55.0, 45.0)


class Loop:
    """A bridged loop in this process, with a controller that wants constant OPs."""

    def __init__(self, graph: Graph, plant: PlantProcess) -> None:
        self.graph, self.plant = graph, plant
        self.grants: list[str] = []
        self.before = Counter(one["event"] for one in plant.events())
        self.wanted: tuple[float, ...] | None = OPS
        graph.listen()
        self.controller = graph.plain("controller")
        self.op = self.controller.create_publisher(JointState, "op", SIGNAL_QOS)
        self.controller.create_subscription(JointState, "pv", self.answer, SIGNAL_QOS)
        tell = self.grants.append
        self.controller.create_subscription(
            String, "grant", lambda message: tell(message.data), LATCHED_QOS
        )

    def bridge(self, **changes: Any) -> OpcuaNode:
        values = self.plant.parameters() | changes
        overrides = [Parameter(key, value=value) for key, value in values.items()]
        self.node = OpcuaNode(context=self.graph.context, parameter_overrides=overrides)
        return self.graph.adopt(self.node)

    def answer(self, pv: JointState) -> None:
        if self.wanted is not None:
            message = joint_state(to_ns(pv.header.stamp), ("V1", "V2"), self.wanted)
            message.header.frame_id = "/controller"
            self.op.publish(message)

    def operate(self, mode: str) -> None:
        """Let the operator choose a mode, while the loop goes on; remote needs a beat first."""
        if mode == "ROUT":
            counts = self.node.bridges["tank"].counts
            self.graph.spin_until(lambda: counts["beat_written"], "a beat")
        operator = threading.Thread(target=self.plant.grant, args=(mode,))
        operator.start()
        self.graph.spin_until(lambda: not operator.is_alive(), "the operator")

    def news(self, kind: str) -> list[dict[str, Any]]:
        """Return what the plant has noted since this test began."""
        return self.plant.events(kind)[self.before[kind] :]

    def seen(self, topic: str) -> list[Any]:
        return self.graph.seen[topic]

    def texts(self) -> str:
        return " | ".join(
            f"{status.name}: {status.message}"
            for message in self.seen("/diagnostics")
            for status in message.status
        )


pytestmark = pytest.mark.alone


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PlantProcess]:
    process = PlantProcess(tmp_path_factory.mktemp("unit") / "plant")
    process.start()
    yield process
    process.stop()


@pytest.fixture
def loop(plant: PlantProcess) -> Iterator[Loop]:
    graph = Graph()
    yield Loop(graph, plant)
    graph.close()
    if plant.events("mode")[-1]["mode"] != "AUTO":
        plant.grant("AUTO")


def test_it_listens_and_writes_nothing(loop: Loop) -> None:
    node = loop.bridge()
    node.start()
    assert node.failure == ""
    loop.graph.spin_until(lambda: len(loop.seen("pv")) >= 12, "twelve samples")
    pv, applied = loop.seen("pv"), loop.seen("op_applied")
    stamps = [to_ns(message.header.stamp) for message in pv]
    assert set(np.diff(stamps)) == {60_000_000_000}
    assert list(pv[5].name) == ["C", "T"]
    assert list(pv[5].effort) == [0.0, 0.0]
    # The first samples may be over before every tag has been reported.
    finite = np.isfinite([message.position for message in pv]).all(axis=1)
    assert finite[np.argmax(finite) :].all()
    assert finite.sum() >= 8
    assert {tuple(message.name) for message in applied} == {("V1", "V2")}
    assert len(loop.seen("sp")) >= 8
    outs = {one["stamp"]: one["out"] for one in loop.plant.events("out")}
    for message in applied[3:]:
        assert list(message.position) == outs[to_ns(message.header.stamp)]
    assert loop.news("op") == []
    assert loop.news("denied") == []
    assert loop.grants == []


def test_asked_granted_taken_back(loop: Loop) -> None:
    node = loop.bridge(write=["tank"])
    node.start()
    loop.graph.spin_until(lambda: len(loop.seen("pv")) >= 5, "samples")
    client = loop.controller.create_client(Trigger, "ask_grant")
    loop.graph.spin_until(client.service_is_ready, "the service")
    answer = client.call_async(Trigger.Request())
    loop.graph.spin_until(answer.done, "its answer")
    assert answer.result().success
    assert answer.result().message.startswith("asked for")
    loop.graph.spin_until(lambda: "asked" in loop.grants, "the request")
    assert loop.news("op") == []
    loop.operate("ROUT")
    loop.graph.spin_until(lambda: "granted" in loop.grants, "the grant")
    loop.graph.spin_until(lambda: loop.news("out")[-1]["out"] == list(OPS), "the wanted OP")
    heard = len(loop.seen("pv"))
    loop.graph.spin_until(lambda: len(loop.seen("pv")) >= heard + 10, "samples under the grant")
    loop.operate("AUTO")
    loop.graph.spin_until(lambda: loop.grants[-1] == "idle", "the end of the grant")
    written = len(loop.news("op"))
    heard = len(loop.seen("pv"))
    loop.graph.spin_until(lambda: len(loop.seen("pv")) >= heard + 5, "further samples")
    assert len(loop.news("op")) == written
    assert all(one["taken"] for one in loop.news("op"))
    assert_frames_tell_whose_op_is_in_force(loop)
    # An OP that is under way when the operator takes control back is refused by the plant.
    back = loop.news("mode")[-1]["wall"]
    assert all(one["wall"] >= back for one in loop.news("refused"))
    assert "taken back" in loop.texts() or "not written" in loop.texts()


def assert_frames_tell_whose_op_is_in_force(loop: Loop) -> None:
    """The plant's journal knows whose OP acted, but for a sample at each transfer."""
    begun = [one["stamp"] for one in loop.news("mode")]
    remote = {one["stamp"] for one in loop.news("out") if one["mode"] == "ROUT"}
    seen = set()
    for message in loop.seen("op_applied")[3:]:
        stamp, by = to_ns(message.header.stamp), message.header.frame_id
        if all(abs(stamp - one) > 2 * 60_000_000_000 for one in begun):
            assert by == ("/controller" if stamp in remote else "/opcua")
            seen.add(by)
    assert seen == {"/controller", "/opcua"}


def test_give_back_by_service_and_by_ending(loop: Loop) -> None:
    node = loop.bridge(write=["tank"], ask="start")
    node.start()
    loop.graph.spin_until(lambda: "asked" in loop.grants, "the request")
    loop.operate("ROUT")
    loop.graph.spin_until(lambda: "granted" in loop.grants, "the grant")
    node.trigger_deactivate()
    assert node.bridges["tank"].grant.state is GrantState.IDLE
    last = loop.news("mode")[-1]
    assert (last["mode"], last["alarm"]) == ("AUTO", "request taken back")


def test_a_lost_connection_is_told_and_mended(loop: Loop) -> None:
    relay = Relay(loop.plant.port)
    try:
        node = loop.bridge(
            url=f"opc.tcp://127.0.0.1:{relay.port}/plant", write=["tank"], ask="start"
        )
        node.start()
        loop.graph.spin_until(lambda: "asked" in loop.grants, "the request")
        loop.operate("ROUT")
        loop.graph.spin_until(lambda: "granted" in loop.grants, "the grant")
        relay.cut()
        loop.graph.spin_until(lambda: loop.grants[-1] == "idle", "the end of the grant")
        loop.graph.spin_until(lambda: np.isnan(loop.seen("pv")[-1].position).all(), "no values")
        assert list(loop.seen("pv")[-1].effort) == [3.0, 3.0]
        reasons = ("nothing is heard of the server", "not written")  # whichever came first
        loop.graph.spin_until(lambda: any(one in loop.texts() for one in reasons), "the reason")
        levels = [s.level for m in loop.seen("/diagnostics")[-3:] for s in m.status]
        assert max(levels) == b"\x02"
        loop.graph.spin_until(lambda: loop.news("mode")[-1]["mode"] == "AUTO", "the watchdog")
        relay.mend()
        loop.graph.spin_until(
            lambda: np.isfinite(loop.seen("pv")[-1].position).all(), "values again"
        )
        stamps = [to_ns(message.header.stamp) for message in loop.seen("pv")]
        assert set(np.diff(stamps)) == {60_000_000_000}
        assert loop.grants[-1] == "idle"
        node.trigger_deactivate()
    finally:
        relay.close()


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"tags": ""}, "no tag map"),
        ({"write": ["tank"], "user": "", "password_file": ""}, "anonymously"),
        ({"write": ["tank"], "security": "none", "user": ""}, "without security"),
        ({"write": ["boiler"]}, "no loop 'boiler'"),
        ({"url": "opc.tcp://me:sesame@127.0.0.1:1"}, "holds a user"),
        ({"url": "opc.tcp://127.0.0.1:99999/unit"}, "'99999' is no port"),
        ({"private_key": ""}, "private_key"),
    ],
)
def test_what_cannot_be_bridged_is_said(loop: Loop, changes: dict[str, Any], match: str) -> None:
    node = loop.bridge(**changes)
    node.start()
    assert match in node.failure
    assert "sesame" not in node.failure


def test_secrets_are_nowhere(loop: Loop, capfd: pytest.CaptureFixture[str]) -> None:
    node = loop.bridge(write=["tank"], user="reader", password_file=loop.plant.word("operator"))
    configs: list[String] = []
    loop.controller.create_subscription(String, "opcua/config", configs.append, LATCHED_QOS)
    node.start()
    loop.graph.spin_until(lambda: "BadUserAccessDenied" in loop.texts(), "the refusal")
    loop.graph.spin_until(lambda: configs, "the configuration")
    told = loop.texts() + configs[0].data + "".join(capfd.readouterr())
    for user in USERS:
        assert loop.plant.password_file(user).read_text() not in told
    assert "PRIVATE KEY" not in told


def test_the_bridge_opens_no_port_and_the_plant_one_of_this_machine(
    loop: Loop, tmp_path: Path
) -> None:
    from stiction_ros.cli.shared.node_processes import ros_environment
    from stiction_ros.cli.shared.scenarios import write_parameters

    values = loop.plant.parameters()
    write_parameters({"opcua": values}, tmp_path / "parameters.yaml")
    told = ["--ros-args", "--params-file", str(tmp_path / "parameters.yaml")]
    node = subprocess.Popen(
        [sys.executable, "-P", "-m", "stiction_ros.nodes", "opcua", *told],
        env=ros_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert node.stdout is not None
    try:
        assert any("connected to" in line for line in node.stdout)
        assert listening_of(node.pid) == []
    finally:
        node.send_signal(signal.SIGTERM)
        assert node.wait(BUDGET) == 0
        node.stdout.close()
    assert listening_of(loop.plant.pid) == [f"0100007F:{loop.plant.port:04X}"]
