"""The suite's own node: hears what the loop says, and says what it should not have to hear."""

import functools
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from stiction_ros.nodes.shared.managed import LATCHED_QOS, READER_QOS, SIGNAL_QOS
from stiction_studies.faults.loop.rules import Rule, as_it_is
from stiction_studies.faults.observation import Known, Sampled, Shown

SECOND = 1_000_000_000
HEARD = ("pv", "op", "op_applied")
LEVELS = {b"\x00": "ok", b"\x01": "warn", b"\x02": "error", b"\x03": "error"}
ANSWER = 10.0  # s for a service to answer


class Probe:
    """One node in this process, spun by a thread; what it heard lies in its lists."""

    def __init__(
        self,
        environment: Mapping[str, str],
        commander: str = "/controller",
        topics: Sequence[str] = HEARD,
    ) -> None:
        """Join the domain that ``environment`` names.

        Args:
            environment: as the nodes get it.
            commander: full name of the node whose ``op`` counts.
            topics: signals that are heard, besides the diagnostics.
        """
        for name in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE"):
            if name in environment:
                os.environ[name] = environment[name]
        self.context = Context()
        self.context.init(domain_id=int(environment["ROS_DOMAIN_ID"]))
        self.node = Node("faults", context=self.context)
        self.commander = commander
        self.heard: dict[str, list[Sampled]] = {}
        self.statuses: list[Shown] = []
        self.tasks: list[Shown] = []  # the same of single tasks, by name of the status
        self.values: dict[str, dict[str, str]] = {}  # by name of the status
        self.known = Known()
        self.unheard: list[str] = []  # topics on which nobody heard what was said
        self._own: set[tuple[str, int, bytes]] = set()
        self._rules: dict[str, Rule] = {}
        self._publishers: dict[str, Publisher] = {}
        self._nodes: list[Node] = [self.node]
        for topic in topics:
            self.hear(topic)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_status, READER_QOS)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._gone: deque[Callable[[], object]] = deque()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._spin, name="probe", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave the domain."""
        self._stop.set()
        self._thread.join(5.0)
        for node in self._nodes:
            self._executor.remove_node(node)
            node.destroy_node()
        self._executor.shutdown()
        self.context.try_shutdown()

    def _spin(self) -> None:
        while not self._stop.is_set():
            self._executor.spin_once(timeout_sec=0.1)
            while self._gone:
                self._gone.popleft()()

    def _destroy(self, action: Callable[[], object]) -> None:
        """Have the thread that spins destroy an entity: it must not be waited for meanwhile."""
        self._gone.append(action)
        self._executor.wake()

    # ---- what is heard ---------------------------------------------------------------------

    def hear(self, topic: str) -> None:
        """Hear one more topic of signals from now on."""
        self.heard[topic] = []
        self.node.create_subscription(JointState, topic, self._hearing(topic), READER_QOS)

    def _hearing(self, topic: str) -> Callable[[Any], None]:
        taken = self.heard[topic]

        def take(message: Any) -> None:
            wall = time.monotonic()
            stamp = _ns(message)
            if self._own and (topic, stamp, bytes(message.position)) in self._own:
                return
            if topic == "op" and message.header.frame_id != self.commander:
                return
            if message.position:
                taken.append(Sampled(wall, stamp, tuple(message.position)))

        return take

    def _on_status(self, message: Any) -> None:
        wall = time.monotonic()
        for one in message.status:
            node, _, task = one.name.partition(": ")
            values = {entry.key: entry.value for entry in one.values}
            self.values[one.name] = values
            if task == "mode" and node == self.commander.lstrip("/"):
                self.known = Known(values.get("mode", ""), _frictions(values), _ns(message))
            level = LEVELS.get(bytes(one.level), "error")
            if task == "status":
                self.statuses.append(Shown(wall, node, level, one.message))
            else:
                self.tasks.append(Shown(wall, one.name, level, one.message))

    # ---- what is said ----------------------------------------------------------------------

    def signal(
        self,
        topic: str,
        stamp: int,
        names: Sequence[str],
        values: Sequence[float],
        frame_id: str = "",
    ) -> None:
        """Publish one JointState that is not counted as heard."""
        message = JointState()
        _set_stamp(message.header.stamp, stamp)
        message.header.frame_id = frame_id
        message.name, message.position = list(names), [float(value) for value in values]
        self._own.add((topic, stamp, bytes(message.position)))
        self._publisher(JointState, topic, SIGNAL_QOS).publish(message)

    def text(self, topic: str, text: str) -> None:
        """Publish one text that late comers get as well."""
        self._publisher(String, topic, LATCHED_QOS).publish(String(data=text))

    def clock(self, stamp: int) -> None:
        """Publish one simulated time."""
        message = Clock()
        _set_stamp(message.clock, stamp)
        self._publisher(Clock, "/clock", SIGNAL_QOS).publish(message)

    def preview(
        self,
        stamp: int,
        names: Sequence[str],
        rows: Sequence[Sequence[float]],
        times: Sequence[int],
    ) -> None:
        """Publish set-points to come: ``rows`` at ``times`` in ns from ``stamp``."""
        message = JointTrajectory()
        _set_stamp(message.header.stamp, stamp)
        message.joint_names = list(names)
        for row, after in zip(rows, times, strict=True):
            point = JointTrajectoryPoint(positions=[float(value) for value in row])
            _set_stamp(point.time_from_start, after)
            message.points.append(point)
        self._publisher(JointTrajectory, "sp_preview", SIGNAL_QOS).publish(message)

    def publishers(self, topic: str) -> int:
        """Return how many nodes publish a topic."""
        name = self.node.resolve_topic_name(topic)
        return len(self.node.get_publishers_info_by_topic(name))

    def silence(self, topic: str) -> None:
        """Take back the publisher of a topic."""
        publisher = self._publishers.pop(topic, None)
        if publisher is not None:
            self._destroy(functools.partial(self.node.destroy_publisher, publisher))

    def _publisher(self, kind: Any, topic: str, qos: QoSProfile) -> Publisher:
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(kind, topic, qos)
            end = time.monotonic() + 2.0
            while time.monotonic() < end and not self._matched(topic):
                time.sleep(0.02)
            if not self._matched(topic):
                self.unheard.append(topic)
        return self._publishers[topic]

    def _matched(self, topic: str) -> bool:
        name = self.node.resolve_topic_name(topic)
        wanted = self.node.get_subscriptions_info_by_topic(name)
        matched: int = self._publishers[topic].get_subscription_count()
        return 0 < len(wanted) <= matched

    # ---- relays ----------------------------------------------------------------------------

    def relay(self, topic: str) -> None:
        """Hand ``TOPIC_direct`` on as ``TOPIC``; :meth:`rule` says what becomes of it."""
        publisher = self.node.create_publisher(JointState, topic, READER_QOS)
        self._rules[topic] = as_it_is

        def hand_on(message: Any) -> None:
            for one in self._rules[topic](message):
                publisher.publish(one)

        self.node.create_subscription(JointState, f"{topic}_direct", hand_on, READER_QOS)

    def rule(self, topic: str, rule: Rule | None = None) -> None:
        """Let ``rule`` turn each message of a relay into those that are handed on."""
        self._rules[topic] = as_it_is if rule is None else rule

    # ---- services --------------------------------------------------------------------------

    def set_parameters(self, node: str, values: Mapping[str, Any]) -> list[bool]:
        """Set parameters of ``node``; return which were taken, empty when it did not answer."""
        request = SetParameters.Request()
        wanted = (Parameter(name, value=value) for name, value in values.items())
        request.parameters = [one.to_parameter_msg() for one in wanted]
        answer = self._call(SetParameters, f"{node}/set_parameters", request)
        return [] if answer is None else [bool(one.successful) for one in answer.results]

    def change_state(self, node: str, transition: int) -> bool:
        """Ask ``node`` for a lifecycle transition; return whether it was done."""
        request = ChangeState.Request()
        request.transition.id = transition
        answer = self._call(ChangeState, f"{node}/change_state", request)
        return answer is not None and bool(answer.success)

    def trigger(self, name: str) -> str:
        """Call a service without arguments; return what it says, empty when it did not answer."""
        answer = self._call(Trigger, name, Trigger.Request())
        return "" if answer is None else str(answer.message)

    def _call(self, kind: Any, name: str, request: Any) -> Any:
        client = self.node.create_client(kind, name)
        try:
            if not client.wait_for_service(ANSWER):
                return None
            done = threading.Event()
            future: Any = client.call_async(request)
            future.add_done_callback(lambda _future: done.set())
            return future.result() if done.wait(ANSWER) else None
        finally:
            self._destroy(functools.partial(self.node.destroy_client, client))


def _frictions(values: Mapping[str, str]) -> dict[str, float]:
    return {k: float(v) for k, v in values.items() if k.endswith((".f_s", ".f_d"))}


def _ns(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def _set_stamp(stamp: Any, nanoseconds: int) -> None:
    stamp.sec, stamp.nanosec = divmod(nanoseconds, SECOND)
