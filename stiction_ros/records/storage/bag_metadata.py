"""What a bag says of its topics: QoS, types and definitions."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import yaml

VERSION = 9  # version of ``metadata.yaml``: QoS is a list of mappings with enums as words
INFINITE_NS = 2**63 - 1  # nanoseconds by which ROS writes an infinite duration

QOS_WORDS = {
    "history": ("system_default", "keep_last", "keep_all", "unknown"),
    "reliability": ("system_default", "reliable", "best_effort", "unknown", "best_available"),
    "durability": ("system_default", "transient_local", "volatile", "unknown", "best_available"),
}
"""Words of ROS in the order of the numbers that rmw gives them."""


@dataclasses.dataclass(frozen=True)
class Qos:
    """Quality of service that a publisher offers, in words of ROS."""

    history: str = "keep_last"  # ``keep_last``, ``keep_all``, ``system_default`` or ``unknown``
    depth: int = 10  # messages kept when history is ``keep_last``
    reliability: str = "reliable"  # ``reliable``, ``best_effort``, …
    durability: str = "volatile"  # ``volatile``, ``transient_local``, …
    deadline: int = INFINITE_NS  # longest time between two messages, ns
    lifespan: int = INFINITE_NS  # time a message stays valid, ns
    liveliness: str = "automatic"  # ``automatic``, ``manual_by_topic``, …
    liveliness_lease_duration: int = INFINITE_NS  # ns
    avoid_ros_namespace_conventions: bool = False  # as in ROS

    def mapping(self) -> dict[str, Any]:
        """Return the profile as rosbag2 writes it, keys in its order."""
        values: dict[str, Any] = {}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name in ("deadline", "lifespan", "liveliness_lease_duration"):
                value = {"sec": value // 10**9, "nsec": value % 10**9}
            values[field.name] = value
        return values


@dataclasses.dataclass(frozen=True)
class BagTopic:
    """One topic of a bag."""

    name: str  # full topic name
    type: str  # ``sensor_msgs/msg/JointState``
    definition: str  # the message definition with its dependencies, ``ros2msg``
    type_hash: str = ""  # ``RIHS01_…``, empty when not known
    qos_yaml: str = ""  # the offered profiles, the YAML that the channel carries
    encoding: str = "cdr"  # of the messages; ROS 2 writes ``cdr``
    schema_encoding: str = "ros2msg"  # ``ros2msg``; other recorders may write ``ros2idl``

    def __hash__(self) -> int:
        return hash(self.name)  # looked up for every message; the definition is long

    def channel_metadata(self) -> dict[str, str]:
        return {"offered_qos_profiles": self.qos_yaml, "topic_type_hash": self.type_hash}


def qos_yaml(profiles: Sequence[Qos]) -> str:
    """Return the YAML list of ``profiles`` that goes into the channel metadata."""
    return yaml_text([profile.mapping() for profile in profiles]).strip() if profiles else ""


def yaml_text(value: Any) -> str:
    """Return ``value`` as rosbag2 writes it."""
    return yaml.safe_dump(value, sort_keys=False, allow_unicode=True)
