"""One process that fills the windows of all loops in the graph, without a node for each."""

import time
from collections.abc import Callable

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from stiction_ros.nodes.shared.managed import READER_QOS
from stiction_ros.nodes.shared.messages import to_ns
from stiction_ros.nodes.shared.peers import Inlet
from stiction_ros.nodes.shared.typed import leave
from stiction_ros.online.loop_windows import LoopWindow

LOOK = 0.2  # s between two looks at what has come; 5000 messages of a topic may wait
SEARCH = 2.0  # s between two looks for loops that are new
KIND = "sensor_msgs/msg/JointState"


class Listener:
    """Reads ``pv`` and ``op_applied`` of every loop that publishes both.

    Nothing is spun: what waits on each subscription is taken at every look. So a look at 400 topics
    costs some milliseconds, where an executor would wait on each of them.
    """

    def __init__(self, sample_time: float, window: int) -> None:
        """Join the graph; ``sample_time`` in s, ``window`` in samples."""
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node("listener", start_parameter_services=False)
        self.windows: dict[str, LoopWindow] = {}
        self._sample_time, self._window = sample_time, window
        self._inlets: list[Inlet] = []

    def run(self, seconds: float, progress: Callable[[float], None]) -> None:
        """Listen for ``seconds``."""
        begin = search = time.monotonic()
        while (now := time.monotonic()) - begin < seconds:
            if now >= search:
                self._find_loops()
                search = now + SEARCH
            for inlet in self._inlets:
                inlet.drain()
            progress((now - begin) / seconds)
            time.sleep(LOOK)

    def close(self) -> None:
        """Leave the graph."""
        leave(self.node)

    def _find_loops(self) -> None:
        kinds = dict(self.node.get_topic_names_and_types())
        for topic in sorted(kinds):
            space = topic.removesuffix("/pv")
            applied = f"{space}/op_applied"
            if not topic.endswith("/pv") or KIND not in kinds[topic] or applied not in kinds:
                continue
            name = space.strip("/").replace("/", "_") or "loop"
            if name not in self.windows:
                window = LoopWindow(name, self._sample_time, self._window)
                self.windows[name] = window
                self._listen(applied, _reader(window.add_applied))
                self._listen(topic, _reader(window.add_pv))

    def _listen(self, topic: str, take: Callable[[JointState], None]) -> None:
        subscription = self.node.create_subscription(JointState, topic, take, READER_QOS)
        self._inlets.append(Inlet(subscription, (), READER_QOS))


def _reader(add: Callable[..., None]) -> Callable[[JointState], None]:
    def take(message: JointState) -> None:
        values = np.array(message.position, dtype=float)
        if len(values) == len(message.name):
            add(to_ns(message.header.stamp), message.name, values)

    return take
