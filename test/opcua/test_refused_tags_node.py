"""The node ``opcua`` with a map of which one tag is wrong: the other loops run."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")

sys.path.insert(0, str(Path(__file__).parents[1] / "nodes"))
from graph import Graph
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from small_server import SmallServer

from stiction_ros.nodes.opcua import OpcuaNode
from stiction_ros.nodes.shared.managed import SIGNAL_QOS

pytestmark = pytest.mark.alone


@pytest.fixture
def server() -> Iterator[SmallServer]:
    found = SmallServer(PV=(1.5, "Double"), OP=(40.0, "Double"))
    yield found
    found.close()


@pytest.fixture
def graph() -> Iterator[Graph]:
    found = Graph()
    yield found
    found.close()


def test_one_wrong_tag_silences_only_its_own_loop(
    server: SmallServer, graph: Graph, tmp_path: Path
) -> None:
    path = tmp_path / "unit.tags.yaml"
    loops = [
        {
            "loop": name,
            "sample_time": 0.2,
            "outputs": [{"name": "F", "pv": f"ns=2;s={pv}"}],
            "valves": [{"name": "V1", "op_read": "ns=2;s=OP"}],
        }
        for name, pv in (("FIC101", "PVX"), ("LIC102", "PV"))
    ]
    path.write_text(yaml.safe_dump({"server": server.url, "loops": loops}), encoding="utf-8")
    values = {"tags": str(path), "security": "none", "publishing": 0.05}
    overrides = [Parameter(key, value=value) for key, value in values.items()]
    node = graph.adopt(OpcuaNode(context=graph.context, parameter_overrides=overrides))
    graph.listen()
    heard: list[JointState] = []
    reader = graph.plain("reader")
    reader.create_subscription(JointState, "LIC102/pv", heard.append, SIGNAL_QOS)
    node.start()
    assert node.failure == ""
    graph.spin_until(lambda: len(heard) > 5, "samples of the other loop")
    assert list(heard[-1].position) == [1.5]

    def statuses() -> dict[str, tuple[bytes, str]]:
        messages = graph.seen["/diagnostics"]
        return {one.name: (one.level, one.message) for m in messages for one in m.status}

    wanted = "tag ns=2;s=PVX is refused (BadNodeIdUnknown)"
    graph.spin_until(lambda: statuses().get("opcua: loop FIC101") == (b"\x02", wanted), "the name")
    graph.spin_until(
        lambda: statuses().get("opcua: loop LIC102", (b"\x02",))[0] == b"\x00", "the other loop"
    )
    node.trigger_deactivate()
