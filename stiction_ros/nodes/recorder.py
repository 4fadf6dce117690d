"""The recorder: every topic of the graph into one MCAP bag."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSCompatibility, QoSProfile, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

from stiction_ros.errors import InputError
from stiction_ros.nodes.endpoints import message_class, offered_qos, reader_qos
from stiction_ros.nodes.managed import READER_QOS, ManagedNode
from stiction_ros.nodes.messages import SECOND
from stiction_ros.nodes.runner import run
from stiction_ros.online.node_settings import RecorderNodeSettings
from stiction_ros.records.bag_writer import BagWriter, Packing, Splitting
from stiction_ros.records.message_definitions import definition
from stiction_ros.records.topic_choice import TopicChoice

DISCOVERY_PERIOD = 0.05  # s between two looks at the graph
_CLOCK_BYTES = struct.Struct("<iI")  # sec and nanosec behind the 4 bytes of the encapsulation


class RecorderNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.records.bag_writer.BagWriter`."""

    def __init__(self, **kwargs: Any) -> None:
        """Build the node ``recorder``; ``kwargs`` go to the ROS node."""
        super().__init__("recorder", RecorderNodeSettings, **kwargs)
        self.writer: BagWriter | None = None

    def configure(self) -> None:
        settings = self.settings
        names = [self.resolve_topic_name(name) for name in settings.topics if name]
        self._wanted = TopicChoice.of(names, settings.regex, settings.exclude_regex)
        splitting = Splitting(settings.max_bag_size, round(settings.max_bag_duration * SECOND))
        self.writer = BagWriter(settings.directory, Packing(settings.compression), splitting)
        self._topics: dict[str, QoSProfile] = {}
        self._skipped: dict[str, str] = {}
        self._unheard: dict[str, str] = {}
        self._lost = 0
        self._simulated: int | None = None
        self._looking = [
            self.create_timer(DISCOVERY_PERIOD, self._discover),
            self.create_timer(1.0, self._look_for_unheard),
        ]

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        counts = {} if self.writer is None else self.writer.counts
        keys: list[tuple[str, object]] = [
            (f"recorded:{name}", count) for name, count in counts.items()
        ]
        keys += [(f"skipped:{name}", why) for name, why in self._skipped.items()]
        keys += [(f"unheard:{name}", why) for name, why in self._unheard.items()]
        keys.append(("lost", self._lost))
        if self._lost:
            return "error", f"the storage refused {self._lost} messages", keys
        return ("warn" if self._skipped or self._unheard else "ok"), "recording", keys

    def finish(self) -> None:
        super().finish()
        self.close()

    def close(self) -> None:
        """Finish the bag; what the storage refuses is a failure, the journals stay."""
        if self.writer is None:
            return
        writer, self.writer = self.writer, None
        for timer in self._looking:
            self.destroy_timer(timer)
        try:
            writer.close()
        except OSError as error:
            self.failure = f"{writer.directory}: not finished ({error.strerror}); repair it later"
            self.get_logger().error(self.failure)
        else:
            self.get_logger().info(f"bag finished: {writer.directory}")

    def on_cleanup(self, state: Any) -> Any:
        self.close()
        return super().on_cleanup(state)

    # ---- topics ----------------------------------------------------------------------------

    def _discover(self) -> None:
        """Subscribe to every wanted topic that has appeared since the last look."""
        for name, types in self.get_topic_names_and_types():
            if name in self._topics or name in self._skipped or name not in self._wanted:
                continue
            offered = self.get_publishers_info_by_topic(name)
            if not offered:
                continue
            try:
                if len(types) != 1:
                    raise InputError(f"published as {' and '.join(types)}")
                self._record(name, types[0], offered)
            except InputError as error:
                self._skipped[name] = str(error)
                self.get_logger().warning(f"{name} is not recorded: {error}")

    def _record(self, name: str, kind: str, offered: list[TopicEndpointInfo]) -> None:
        assert self.writer is not None
        text, type_hash = definition(kind)
        self.writer.add_topic(name, kind, text, type_hash, [offered_qos(i) for i in offered])
        qos = reader_qos(offered, READER_QOS.depth)
        self._topics[name] = qos
        self.create_subscription(
            message_class(kind),
            name,
            self._writing(name),
            qos,
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )

    def _look_for_unheard(self) -> None:
        """Tell of publishers that came later and offer less than the subscription asks for."""
        for name, asked in self._topics.items():
            if name in self._unheard:
                continue
            for info in self.get_publishers_info_by_topic(name):
                compatibility, why = qos_check_compatible(info.qos_profile, asked)
                if compatibility == QoSCompatibility.ERROR:  # equal, not the same object
                    self._unheard[name] = f"{info.node_name}: {why.strip()}"
                    self.get_logger().warning(f"{name} of {self._unheard[name]} is not recorded")
                    break

    def _writing(self, topic: str) -> Callable[[bytes, dict[str, int]], None]:
        """Return the callback of one topic; log time is simulated time where there is any."""
        is_clock = topic == "/clock"

        def write(data: bytes, info: dict[str, int]) -> None:
            if self.writer is None:
                return
            if is_clock:
                seconds, rest = _CLOCK_BYTES.unpack_from(data, 4)
                self._simulated = seconds * SECOND + rest
                self.stamp = self._simulated
            received = int(info["received_timestamp"])
            log_time = received if self._simulated is None else self._simulated
            try:
                self.writer.write(topic, data, log_time, int(info["source_timestamp"]))
            except OSError as error:
                self._lost += 1
                if self._lost == 1:
                    self.get_logger().error(f"{self.writer.directory}: {error.strerror}")

        return write


def main() -> int:
    """Run the node."""
    return run("recorder", "Records every topic into one MCAP bag.", RecorderNode)


if __name__ == "__main__":
    raise SystemExit(main())
