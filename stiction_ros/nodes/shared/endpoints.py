"""Topics as the graph shows them: types, what publishers offer, what a reader may ask for."""

import importlib
from collections.abc import Sequence
from typing import Any

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from stiction_ros.errors import InputError
from stiction_ros.nodes.shared.typed import quality
from stiction_ros.records.storage.bag_metadata import INFINITE_NS, Qos


def message_class(kind: str) -> Any:
    """Return the class of the messages of type ``sensor_msgs/msg/JointState``.

    Raises:
        InputError: its package is not installed.
    """
    package, _, name = kind.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError):
        raise InputError(
            f"type {kind} is not installed", fix=f"install and source the package {package}"
        ) from None


def offered_qos(info: TopicEndpointInfo) -> Qos:
    """Return what a publisher offers, as a bag notes it."""
    profile = info.qos_profile
    return Qos(
        history="keep_last",
        depth=profile.depth,
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        deadline=_limit(profile.deadline),
        lifespan=_limit(profile.lifespan),
        liveliness=profile.liveliness.name.lower(),
        liveliness_lease_duration=_limit(profile.liveliness_lease_duration),
    )


def reader_qos(offered: Sequence[TopicEndpointInfo], depth: int) -> QoSProfile:
    """Return the strongest QoS that every one of the publishers serves."""
    profiles = [info.qos_profile for info in offered]
    reliable = all(p.reliability is ReliabilityPolicy.RELIABLE for p in profiles)
    latched = all(p.durability is DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
    return quality(
        depth,
        ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _limit(duration: Duration) -> int:
    """Return a duration in ns; none at all is infinite."""
    return int(duration.nanoseconds) or INFINITE_NS
