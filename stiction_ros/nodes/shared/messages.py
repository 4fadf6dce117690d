"""Between arrays and the messages of common_interfaces, and the topics that carry them."""

import importlib
import itertools
from array import array
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.online.health import LEVELS
from stiction_ros.online.input.samples import picked
from stiction_ros.records.storage.bag_metadata import INFINITE_NS, Qos

if TYPE_CHECKING:  # nodes that control nothing load nothing of control
    from stiction_ros.control import StepResult

SECOND = 1_000_000_000


def to_ns(stamp: Time) -> int:
    """Return a stamp in nanoseconds."""
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def to_stamp(nanoseconds: int) -> Time:
    """Return nanoseconds as a stamp."""
    seconds, rest = divmod(nanoseconds, SECOND)
    return Time(sec=seconds, nanosec=rest)


def joint_state(stamp: int, names: Sequence[str], values: Iterable[float]) -> JointState:
    """Return tags and values as the topics pv, sp, op, stem and dv carry them."""
    message = JointState()
    message.header.stamp = to_stamp(stamp)
    message.name = list(names)
    message.position = array("d", values)
    return message


def values_of(
    message: JointState, names: Sequence[str], *, partly: bool = False
) -> FloatArray | None:
    """Return the values of ``names`` by :func:`picked`."""
    return picked(message.name, message.position, names, partly=partly)


def friction_message(
    stamp: int, by: str, rows: Mapping[str, tuple[float, float, float]]
) -> JointState:
    """Return value, lower and upper end of every friction; empty for an unusable window.

    The ``stamp`` is the end of the window, ns; ``by`` is ``valid_from`` of the loop model in force.
    """
    message = joint_state(stamp, list(rows), [value for value, _, _ in rows.values()])
    message.velocity = [low for _, low, _ in rows.values()]
    message.effort = [high for _, _, high in rows.values()]
    message.header.frame_id = by
    return message


def trajectory(
    stamp: int, names: Sequence[str], rows: FloatArray, times: Sequence[float]
) -> JointTrajectory:
    """Return a plan: ``rows`` (K, names) at ``times`` (K,) seconds from the stamp."""
    message = JointTrajectory()
    message.header.stamp = to_stamp(stamp)
    message.joint_names = list(names)
    for row, time in zip(rows, times, strict=True):
        seconds, rest = divmod(round(time * SECOND), SECOND)
        message.points.append(
            JointTrajectoryPoint(
                positions=array("d", row), time_from_start=Duration(sec=seconds, nanosec=rest)
            )
        )
    return message


def rows_of(message: JointTrajectory, names: Sequence[str]) -> tuple[list[int], FloatArray] | None:
    """Return stamps in ns and rows (K, names) of a trajectory, or None when it does not fit."""
    stamp, columns = to_ns(message.header.stamp), list(message.joint_names)
    if any(name not in columns for name in names):
        return None
    picks = [columns.index(name) for name in names]
    points = message.points
    if not points or any(len(point.positions) != len(columns) for point in points):
        return None
    stamps = [
        stamp + int(p.time_from_start.sec) * SECOND + int(p.time_from_start.nanosec) for p in points
    ]
    if any(b <= a for a, b in itertools.pairwise(stamps)):
        return None
    return stamps, np.array([[point.positions[i] for i in picks] for point in points], dtype=float)


def diagnosis(result: "StepResult") -> list[tuple[str, object]]:
    """Return what diagnostics say of the last control step."""
    gap = result.optimality_gap
    return [
        ("step_status", result.status.value),
        ("strategy", result.strategy),
        ("plan_age", result.age),
        ("slack", " ".join(f"{value:g}" for value in result.slack)),
        ("miss", " ".join(f"{value:g}" for value in result.miss)),
        ("optimality_gap", "" if gap is None else f"{gap:g}"),
    ]


def status(
    name: str, hardware: str, level: str, text: str, values: Iterable[tuple[str, object]]
) -> DiagnosticStatus:
    """Return one diagnostic status; ``level`` is ok, warn or error."""
    return DiagnosticStatus(
        name=name,
        hardware_id=hardware,
        level=bytes([LEVELS.index(level)]),
        message=text,
        values=[KeyValue(key=key, value=str(value)) for key, value in values],
    )


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
        deadline=int(profile.deadline.nanoseconds) or INFINITE_NS,
        lifespan=int(profile.lifespan.nanoseconds) or INFINITE_NS,
        liveliness=profile.liveliness.name.lower(),
        liveliness_lease_duration=int(profile.liveliness_lease_duration.nanoseconds) or INFINITE_NS,
    )


def reader_qos(offered: Sequence[TopicEndpointInfo], depth: int) -> QoSProfile:
    """Return the strongest QoS that every one of the publishers serves."""
    profiles = [info.qos_profile for info in offered]
    reliable = all(p.reliability is ReliabilityPolicy.RELIABLE for p in profiles)
    latched = all(p.durability is DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
