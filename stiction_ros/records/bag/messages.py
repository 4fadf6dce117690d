"""Reads the messages of bags: rosbag2 directories, bare files, unfinished files."""

import dataclasses
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from stiction_ros.errors import InputError
from stiction_ros.records.regular import begun_anew
from stiction_ros.records.storage.bag_metadata import BagTopic
from stiction_ros.records.storage.files import listing_notes, storage_files
from stiction_ros.records.storage.log_time import AGAIN
from stiction_ros.records.storage.mcap_scan import McapScan, RawMessage

_log_time = itemgetter(1)
Wanted = Callable[[BagTopic], bool]


@dataclasses.dataclass(frozen=True, slots=True)
class BagMessage:
    """One decoded message."""

    topic: str  # full topic name
    type: str  # ``sensor_msgs/msg/JointState``
    log_time: int  # when it was received, ns
    publish_time: int  # when it was sent, ns
    message: Any  # its fields as attributes


def read_raw(path: str | Path, notes: list[str] | None = None) -> Iterator[RawMessage]:
    """Yield every message of a bag as bytes, each file by log time.

    Args:
        path: a rosbag2 directory, finished or not, or a ``.mcap`` file.
        notes: gets what was left out, one sentence each.

    Raises:
        InputError: no such bag, or damaged; complete messages before the damage come first.
    """
    counts: Counter[str] = Counter()
    for file in storage_files(path):
        scan = McapScan(file)
        yield from _by_log_time(scan)
        counts += scan.counts
        if notes is not None:
            notes.extend(scan.notes)
    if notes is not None:
        notes.extend(listing_notes(path, counts))


def _by_log_time(scan: McapScan) -> Iterator[RawMessage]:
    """Yield the messages of a file by log time, those of one log time as they stand in the file."""
    held: list[RawMessage] = []
    damage = None
    try:
        for message in scan.messages():
            held.append(message)
    except InputError as error:
        damage = error
    if (scan.chunked or scan.finished) and not _begins_anew(held):
        held.sort(key=_log_time)
    yield from held
    if damage is not None:
        raise damage


def _begins_anew(messages: Iterable[RawMessage]) -> bool:
    """Tell whether log time begins anew, as simulated time does when a plant is restarted."""
    times: dict[str, list[int]] = {}
    for topic, time, _, _ in messages:
        times.setdefault(topic.name, []).append(time)
    return any(len(begun_anew(np.array(one), AGAIN)) > 1 for one in times.values())


def read_messages(
    path: str | Path, *, wanted: Wanted | None = None, notes: list[str] | None = None
) -> Iterator[BagMessage]:
    """Yield the decoded messages, of the topics ``wanted``, in the order of :func:`read_raw`.

    Notes tell, too, of topics that are not in CDR with ``ros2msg`` definitions.

    Raises:
        InputError: no such bag, damaged, or a message that does not fit its definition.
    """
    decoder = MessageDecoder()
    for raw in read_raw(path, notes):
        if wanted is None or wanted(raw.topic):
            message = decoder.decode(raw, str(path))
            if message is not None:
                yield message
    if notes is not None:
        notes.extend(decoder.notes)


class MessageDecoder:
    """Decodes messages by the definitions of the bag; ``notes`` tell which topics it could not."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        self._factory = DecoderFactory()
        self._decoders: dict[BagTopic, Callable[[bytes], Any] | None] = {}

    def decode(self, raw: RawMessage, where: str) -> BagMessage | None:
        """Return the message; None without a definition, InputError when it does not fit."""
        topic = raw.topic
        if topic not in self._decoders:
            self._decoders[topic] = self._decoder(topic)
        decoder = self._decoders[topic]
        if decoder is None:
            return None
        try:
            message = decoder(raw.data)
        except Exception as e:  # any definition may stand there, and its decoder raises anything
            raise InputError(
                f"a message of {topic.name} does not fit its definition ({e})",
                where=where,
                fix="the bag is damaged, record it again",
            ) from e
        return BagMessage(topic.name, topic.type, raw.log_time, raw.publish_time, message)

    def _decoder(self, topic: BagTopic) -> Callable[[bytes], Any] | None:
        schema = Schema(
            id=len(self._decoders) + 1,
            data=topic.definition.encode(),
            encoding=topic.schema_encoding,
            name=topic.type,
        )
        what = f"topic {topic.name} ({topic.type})"
        try:
            decoder = self._factory.decoder_for(topic.encoding, schema)
        except Exception:  # any text may stand there and the parser's errors share no base
            decoder = None
        if not any(line.partition("#")[0].strip() for line in topic.definition.splitlines()):
            what, decoder = f"{what} has no definition and", None
        if decoder is None:
            self.notes.append(f"{what} cannot be decoded, left out")
        return decoder


def last_part(topic: str) -> tuple[str, str]:
    """Return namespace and last part of a topic: ``/unit1/pv`` → ``/unit1``, ``pv``."""
    namespace, _, name = topic.rpartition("/")
    return namespace, name


def stamp_ns(message: Any) -> int:
    """Return the stamp of a message with a header, ns."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)
