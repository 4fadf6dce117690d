"""Nodes of one graph in this process: a private context, one executor, no sleeps."""

import itertools
import os
import random
import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from stiction_ros.nodes.controller import ControllerNode
from stiction_ros.nodes.estimator import EstimatorNode
from stiction_ros.nodes.opcua import OpcuaNode
from stiction_ros.nodes.plant import PlantNode
from stiction_ros.nodes.player import PlayerNode
from stiction_ros.nodes.recorder import RecorderNode
from stiction_ros.nodes.shared.managed import LATCHED_QOS, READER_QOS, ManagedNode

KINDS: dict[str, type[ManagedNode]] = {
    "plant": PlantNode,
    "controller": ControllerNode,
    "estimator": EstimatorNode,
    "recorder": RecorderNode,
    "player": PlayerNode,
    "opcua": OpcuaNode,
}
DOMAINS = itertools.cycle(random.SystemRandom().sample(range(1, 101), 100))
BUDGET = 600.0  # s; a test that needs this long has failed, however busy the machine is

SIGNALS: dict[str, type[Any]] = {
    "pv": JointState,
    "sp": JointState,
    "op": JointState,
    "op_applied": JointState,
    "stem": JointState,
    "stiction": JointState,
    "prediction": JointTrajectory,
    "/clock": Clock,
}
LATCHED = {
    "mode": String,
    "loop_model": String,
    "plant/config": String,
    "controller/config": String,
    "estimator/config": String,
}


class Graph:
    """Nodes that are built, spun and ended together."""

    def __init__(self) -> None:
        # Nothing of another process is discovered, nor what an earlier graph has left.
        before = os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"]
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "OFF"
        try:
            self.context = Context()
            self.context.init(domain_id=next(DOMAINS))
        finally:
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = before
        self.executor = SingleThreadedExecutor(context=self.context)
        self.nodes: list[Node] = []
        self.seen: dict[str, list[Any]] = defaultdict(list)
        self.arrived: dict[str, int] = {}  # messages by topic, where a test counts them

    def add(self, kind: str, values: Mapping[str, Any] | None = None) -> Any:
        """Build a managed node with parameters."""
        overrides = [Parameter(key, value=value) for key, value in (values or {}).items()]
        node = KINDS[kind](context=self.context, parameter_overrides=overrides)
        return self.adopt(node)

    def adopt(self, node: Any) -> Any:
        self.executor.add_node(node)
        self.nodes.append(node)
        return node

    def plain(self, name: str = "probe") -> Node:
        """Build a node that the test itself talks through."""
        return self.adopt(Node(name, context=self.context))

    def peer(self, name: str) -> Node:
        """Build a plain node that says it is ready, as the nodes of ``wait_for`` do."""
        node = self.plain(name)
        node.create_publisher(String, "~/config", LATCHED_QOS)
        return node

    def listen(self, name: str = "recorder") -> Node:
        """Note every message of every topic, under the name that the nodes wait for."""
        node = self.peer(name)
        for topic, kind in SIGNALS.items():
            node.create_subscription(kind, topic, self.seen[topic].append, READER_QOS)
        for topic, kind in LATCHED.items():
            node.create_subscription(kind, topic, self.seen[topic].append, LATCHED_QOS)
        diagnostics = self.seen["/diagnostics"]
        node.create_subscription(
            DiagnosticArray, "/diagnostics", diagnostics.append, QoSProfile(depth=1000)
        )
        return node

    def spin_until(self, condition: Callable[[], Any], what: str) -> None:
        """Spin until ``condition`` holds; fail after a generous budget."""
        end = time.monotonic() + BUDGET
        while not condition():
            assert time.monotonic() < end, f"waited {BUDGET:g} s for {what}"
            self.executor.spin_once(timeout_sec=0.1)

    def spin_some(self, rounds: int = 50) -> None:
        """Give everything that is under way the chance to arrive."""
        for _ in range(rounds):
            self.executor.spin_once(timeout_sec=0.002)

    def close(self) -> None:
        for node in self.nodes:
            if isinstance(node, ManagedNode):
                node.finish()
            self.executor.remove_node(node)
            node.destroy_node()
        self.executor.shutdown()
        self.context.try_shutdown()
