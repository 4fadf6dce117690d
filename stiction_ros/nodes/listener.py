"""One process that fills the windows of all loops in the graph, without a node for each."""

import time
from collections import deque
from collections.abc import Callable, Sequence

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown
from sensor_msgs.msg import JointState

from stiction_ros.nodes.shared.managed import READER_QOS
from stiction_ros.nodes.shared.messages import to_ns
from stiction_ros.nodes.shared.peers import Inlet
from stiction_ros.online.input.samples import picked
from stiction_ros.online.pairing import PairedSample, Pairing
from stiction_ros.records import Record
from stiction_ros.records.record import Quality

LOOK = 0.2  # s between two looks at what has come; 5000 messages of a topic may wait
SEARCH = 2.0  # s between two looks for loops that are new
KIND = "sensor_msgs/msg/JointState"


class LoopWindow:
    """The last samples of one loop, paired as the estimator pairs them.

    Attributes:
        pairs: what pairs PV and OP, and counts what became of stamps.
        samples: up to now, with those that are bad or never came.
    """

    def __init__(self, name: str, sample_time: float, window: int) -> None:
        """Start empty; ``sample_time`` in s, ``window`` in samples."""
        self.name, self.sample_time = name, sample_time
        self.pairs = Pairing(sample_time)
        self._window: deque[PairedSample] = deque(maxlen=window)
        self._tags: dict[str, tuple[str, ...]] = {}  # as the first message of each topic has them
        self.samples = 0

    def take(self, topic: str, stamp: int, tags: Sequence[str], values: Sequence[float]) -> None:
        """Take in a message of ``pv`` or ``op_applied``, stamp in ns; other tags are left out."""
        found = picked(tags, values, self._tags.setdefault(topic, tuple(tags)))
        if found is None:
            return
        add = self.pairs.add_pv if topic == "pv" else self.pairs.add_applied
        for one in add(stamp, found):
            if one.begins:
                self._window.clear()
            self.samples += 1
            self._window.append(one)

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
            self._tags["op_applied"],
            self._tags["pv"],
            op,
            pv,
            start=rows[0].stamp / 1e9,
            mask=mask,
        )


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
                self._listen(window, applied, "op_applied")
                self._listen(window, topic, "pv")

    def _listen(self, window: LoopWindow, topic: str, kind: str) -> None:
        def take(message: JointState) -> None:
            window.take(kind, to_ns(message.header.stamp), message.name, message.position)

        subscription = self.node.create_subscription(JointState, topic, take, READER_QOS)
        self._inlets.append(Inlet(subscription, (), READER_QOS))
