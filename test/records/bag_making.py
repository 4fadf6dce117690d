"""Messages as bytes, made by `rosbags` so that no ROS is needed."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rosbags.typesys import Stores, get_typestore

from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.record import Record
from stiction_ros.records.run.loop_runs import read_bag_parts
from stiction_ros.records.storage.bag_metadata import Qos

STORE = get_typestore(Stores.ROS2_JAZZY)
JOINT_STATE = "sensor_msgs/msg/JointState"
SECOND = 10**9
LATCHED = Qos(depth=1, durability="transient_local")


def read_bag(path: Path, namespace: str | None = None) -> Record:
    """Return the one record of a loop in a bag."""
    (only,) = read_bag_parts(path, namespace=namespace)
    return only


def message(type_name: str, *fields: object) -> object:
    """Return a message of `rosbags` from its fields in order."""
    return STORE.types[type_name](*fields)


def cdr(type_name: str, *fields: object) -> bytes:
    """Return the serialised message."""
    return bytes(STORE.serialize_cdr(message(type_name, *fields), type_name))


def header(stamp: int, frame: str = "") -> object:
    time = message("builtin_interfaces/msg/Time", stamp // SECOND, stamp % SECOND)
    return message("std_msgs/msg/Header", time, frame)


def joint_state(
    stamp: int,
    names: Sequence[str],
    position: Sequence[float],
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
    frame: str = "",
) -> bytes:
    arrays = [np.array(values, dtype=float) for values in (position, velocity, effort)]
    return cdr(JOINT_STATE, header(stamp, frame), list(names), *arrays)


def text(data: str) -> bytes:
    return cdr("std_msgs/msg/String", data)


def clock(stamp: int) -> bytes:
    time = message("builtin_interfaces/msg/Time", stamp // SECOND, stamp % SECOND)
    return cdr("rosgraph_msgs/msg/Clock", time)


def diagnostics(stamp: int, name: str, values: dict[str, str]) -> bytes:
    pairs = [message("diagnostic_msgs/msg/KeyValue", key, value) for key, value in values.items()]
    status = message("diagnostic_msgs/msg/DiagnosticStatus", 0, name, "", "", pairs)
    return cdr("diagnostic_msgs/msg/DiagnosticArray", header(stamp), [status])


def trajectory(stamp: int, names: Sequence[str], first: Sequence[float]) -> bytes:
    nothing = np.array([])
    start = message("builtin_interfaces/msg/Duration", 0, 0)
    position = np.array(first, dtype=float)
    kind = "trajectory_msgs/msg/JointTrajectoryPoint"
    point = message(kind, position, nothing, nothing, nothing, start)
    return cdr("trajectory_msgs/msg/JointTrajectory", header(stamp), list(names), [point])


@dataclasses.dataclass
class Bag:
    """A bag writer that knows the types of its messages and remembers what it wrote."""

    writer: BagWriter
    written: list[tuple[str, int, bytes]] = dataclasses.field(default_factory=list)

    def put(self, topic: str, type_name: str, data: bytes, time: int, qos: Qos = Qos()) -> None:  # noqa: B008
        if topic not in self.writer.counts:
            definition, _ = STORE.generate_msgdef(type_name, ros_version=2)
            self.writer.add_topic(topic, type_name, definition, STORE.hash_rihs01(type_name), qos)
        self.writer.write(topic, data, time, time)
        self.written.append((topic, time, data))

    def joint(self, topic: str, stamp: int, values: dict[str, float]) -> None:
        data = joint_state(stamp, list(values), list(values.values()))
        self.put(topic, JOINT_STATE, data, stamp, Qos(depth=100))

    def text(self, topic: str, data: str, time: int) -> None:
        self.put(topic, "std_msgs/msg/String", text(data), time, LATCHED)

    def diagnostics(self, stamp: int, name: str, values: dict[str, str]) -> None:
        data = diagnostics(stamp, name, values)
        self.put("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", data, stamp)

    def prediction(self, stamp: int, names: Sequence[str], first: Sequence[float]) -> None:
        data = trajectory(stamp, names, first)
        self.put("/prediction", "trajectory_msgs/msg/JointTrajectory", data, stamp)

    def loop(self, samples: int, space: str = "", start: int = 5 * SECOND) -> None:
        """Write ``samples`` samples of one loop, one second apart."""
        for k in range(samples):
            stamp = start + k * SECOND
            self.joint(f"{space}/pv", stamp, {"C": 7.0 + k, "T": 40.0 - k})
            self.joint(f"{space}/sp", stamp, {"C": 7.5, "T": 42.0})
            self.joint(f"{space}/op", stamp, {"V1": 50.0 + k, "V2": 49.0})
            self.joint(f"{space}/stem", stamp, {"V1": 48.0, "V2": 49.0})
