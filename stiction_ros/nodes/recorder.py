"""The recorder: every topic of the graph into one MCAP bag."""

from __future__ import annotations

import importlib
import re
import struct
from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from stiction_ros.errors import InputError
from stiction_ros.nodes.managed import READER_QOS, ManagedNode
from stiction_ros.nodes.messages import SECOND
from stiction_ros.nodes.runner import run
from stiction_ros.online.node_settings import RecorderNodeSettings
from stiction_ros.records.bag_metadata import Qos
from stiction_ros.records.bag_writer import BagWriter, Packing
from stiction_ros.records.message_definitions import definition

DISCOVERY_PERIOD = 0.05  # s between two looks at the graph
_CLOCK_BYTES = struct.Struct("<iI")  # sec and nanosec behind the 4 bytes of the encapsulation


class RecorderNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.records.bag_writer.BagWriter`."""

    def __init__(self, **kwargs: Any) -> None:
        """Build the node ``recorder``; ``kwargs`` go to the ROS node."""
        super().__init__("recorder", RecorderNodeSettings, **kwargs)
        self.writer: BagWriter | None = None

    def configure(self) -> None:
        try:
            self._wanted = re.compile(self.settings.topics)
        except re.error as error:
            raise InputError(f"no regular expression ({error})", where="recorder: topics") from None
        self.writer = BagWriter(self.settings.directory, Packing(self.settings.compression))
        self._topics: dict[str, str] = {}
        self._skipped: dict[str, str] = {}
        self._simulated: int | None = None
        self._discovery = self.create_timer(DISCOVERY_PERIOD, self._discover)

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        counts = {} if self.writer is None else self.writer.counts
        keys: list[tuple[str, object]] = [
            (f"recorded:{name}", count) for name, count in counts.items()
        ]
        keys += [(f"skipped:{name}", why) for name, why in self._skipped.items()]
        return ("warn" if self._skipped else "ok"), "recording", keys

    def finish(self) -> None:
        super().finish()
        self.close()

    def close(self) -> None:
        """Finish the bag."""
        if self.writer is not None:
            self.destroy_timer(self._discovery)
            self.writer.close()
            self.get_logger().info(f"bag finished: {self.writer.directory}")
            self.writer = None

    def on_cleanup(self, state: Any) -> Any:
        self.close()
        return super().on_cleanup(state)

    # ---- topics ----------------------------------------------------------------------------

    def _discover(self) -> None:
        """Subscribe to every wanted topic that has appeared since the last look."""
        for name, types in self.get_topic_names_and_types():
            if name in self._topics or name in self._skipped or not self._wanted.fullmatch(name):
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
        self.writer.add_topic(name, kind, text, type_hash, [_offered(i) for i in offered])
        profiles = [info.qos_profile for info in offered]
        reliable = all(p.reliability is ReliabilityPolicy.RELIABLE for p in profiles)
        latched = all(p.durability is DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
        qos = QoSProfile(
            depth=READER_QOS.depth,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        self._topics[name] = kind
        self.create_subscription(
            _message_class(kind),
            name,
            self._writing(name),
            qos,
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )

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
            self.writer.write(topic, data, log_time, int(info["source_timestamp"]))

        return write


def _message_class(kind: str) -> Any:
    package, _, name = kind.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise InputError(
            f"type {kind} is not installed", fix=f"install and source the package {package}"
        ) from None


def _offered(info: TopicEndpointInfo) -> Qos:
    profile = info.qos_profile
    return Qos(
        history="keep_last",
        depth=profile.depth,
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
    )


def main() -> int:
    """Run the node."""
    return run("recorder", "Records every topic into one MCAP bag.", RecorderNode)


if __name__ == "__main__":
    raise SystemExit(main())
