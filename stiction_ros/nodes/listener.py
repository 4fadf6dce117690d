"""One process that fills the windows of all loops in the graph, without a node for each."""

import time
from collections import Counter, deque
from collections.abc import Callable, Sequence

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown
from sensor_msgs.msg import JointState

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.nodes.shared.managed import READER_QOS
from stiction_ros.nodes.shared.messages import to_ns
from stiction_ros.nodes.shared.peers import Inlet
from stiction_ros.online.pairing import PairedSample, Pairing
from stiction_ros.records import Record
from stiction_ros.records.record import Quality

LOOK = 0.2  # s between two looks at what has come; 5000 messages of a topic may wait
SEARCH = 2.0  # s between two looks for loops that are new
KIND = "sensor_msgs/msg/JointState"


class LoopWindow:
    """The last samples of one loop, paired as the estimator pairs them.

    Attributes:
        samples: up to now, with those that are bad or never came.
    """

    def __init__(self, name: str, sample_time: float, window: int) -> None:
        """Start empty; ``sample_time`` in s, ``window`` in samples."""
        self.name, self.sample_time = name, sample_time
        self._pairs = Pairing(sample_time)
        self._window: deque[PairedSample] = deque(maxlen=window)
        self._valves: tuple[str, ...] = ()
        self._outputs: tuple[str, ...] = ()
        self.samples = 0

    def add_pv(self, stamp: int, outputs: Sequence[str], pv: FloatArray) -> None:
        """Take in a PV, stamp in ns."""
        self._outputs = self._outputs or tuple(outputs)
        if tuple(outputs) == self._outputs:
            self._keep(self._pairs.add_pv(stamp, pv))

    def add_applied(self, stamp: int, valves: Sequence[str], op: FloatArray) -> None:
        """Take in an OP that was in force, stamp in ns."""
        self._valves = self._valves or tuple(valves)
        if tuple(valves) == self._valves:
            self._keep(self._pairs.add_applied(stamp, op))

    @property
    def counts(self) -> Counter[str]:
        """What became of stamps, as :class:`Pairing` counts it."""
        return self._pairs.counts

    def __len__(self) -> int:
        return len(self._window)

    def record(self) -> Record | None:
        """Return the samples as a record; None for fewer than two."""
        rows = self._window
        if len(rows) < 2:
            return None
        pv = np.array([row.pv for row in rows])
        bad = ~np.isfinite(pv).all(axis=1)
        mask = np.where(bad, Quality.BAD, Quality.GOOD).astype(np.uint8)
        op = np.array([row.op for row in rows])
        return Record(
            self.name,
            self.sample_time,
            self._valves,
            self._outputs,
            op,
            pv,
            start=rows[0].stamp / 1e9,
            mask=mask,
        )

    def _keep(self, found: Sequence[PairedSample]) -> None:
        for one in found:
            if one.begins:
                self._window.clear()
            self.samples += 1
            self._window.append(one)


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
        self.node.destroy_node()
        try_shutdown()

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
