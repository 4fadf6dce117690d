"""Writes a record as a bag of the topics ``pv``, ``op``, ``sp`` and ``stem``."""

import itertools
import struct
from collections.abc import Sequence
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.records.bag.message_definitions import definition
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.record import Record
from stiction_ros.records.run.loop_signals import JOINT_STATE
from stiction_ros.records.storage.bag_metadata import Qos

SECOND = 10**9
QOS = Qos(depth=100)
_LITTLE_ENDIAN = b"\x00\x01\x00\x00"
_LATEST = 2**31 * SECOND  # seconds of a stamp are a signed 32-bit number


def write_bag(record: Record, directory: str | Path) -> dict[str, int]:
    """Write ``record`` as a rosbag2 bag; log time and publish time are the samples' stamps.

    Gaps and runs come back when it is read; a bag has no place for the mask, but for bad
    samples, which are NaN. Where stamps fall back log time stands still.

    Args:
        record: its ``start`` is the stamp of the first sample, s.
        directory: the bag, made with its parents, must not hold anything yet.

    Returns:
        Messages by topic.

    Raises:
        InputError: stamps before 0 or beyond what a ROS stamp holds; the message definitions
            of ``sensor_msgs`` are not installed; the directory holds something.

    Examples:
        >>> from stiction_ros import LoopModel, find_config, read, simulate, write_bag
        >>> record = simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=20)
        >>> write_bag(record, "flow_bag")["/pv"]
        20
        >>> bool((read("flow_bag").op == record.op).all())
        True
    """
    first = round(record.start * SECOND)
    stamps = [first + round(time * SECOND) for time in record.time.tolist()]
    if min(stamps) < 0 or max(stamps) >= _LATEST:
        raise InputError(
            f"begins at {record.start:.9g} s, which no ROS stamp can hold",
            where=record.name,
            fix="use times from 0 to 2 147 483 647 s",
        )
    order = [key for key in ("sp", "pv", "op", "stem") if key in record.signals]
    signals = [(f"/{key}", record.tags(key), record.signals[key]) for key in order]
    text, type_hash = definition(JOINT_STATE)
    with BagWriter(directory) as writer:
        for topic, _, _ in signals:
            writer.add_topic(topic, JOINT_STATE, text, type_hash, QOS)
        for row, (stamp, log) in enumerate(
            zip(stamps, itertools.accumulate(stamps, max), strict=True)
        ):
            for topic, tags, values in signals:
                data = joint_state_bytes(stamp, tags, values[row].tolist())
                writer.write(topic, data, log, stamp)
        return writer.counts


def joint_state_bytes(stamp: int, names: Sequence[str], position: Sequence[float]) -> bytes:
    """Return a ``sensor_msgs/msg/JointState`` as CDR, little endian; the stamp is in ns."""
    seconds, rest = divmod(stamp, SECOND)
    body = bytearray(struct.pack("<iI", seconds, rest))
    _put_text(body, "")
    _align(body, 4)
    body += struct.pack("<I", len(names))
    for name in names:
        _put_text(body, name)
    for values in (position, (), ()):
        _align(body, 4)
        body += struct.pack("<I", len(values))
        if values:
            _align(body, 8)
            body += struct.pack(f"<{len(values)}d", *values)
    return _LITTLE_ENDIAN + bytes(body)


def _put_text(body: bytearray, text: str) -> None:
    _align(body, 4)
    data = text.encode() + b"\0"
    body += struct.pack("<I", len(data)) + data


def _align(body: bytearray, size: int) -> None:
    body += bytes(-len(body) % size)
