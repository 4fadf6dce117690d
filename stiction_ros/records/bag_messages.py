"""Reads the messages of bags: rosbag2 directories, bare files, unfinished files."""

from __future__ import annotations

import dataclasses
import re
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import yaml
from mcap.exceptions import McapError
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from stiction_ros.errors import InputError
from stiction_ros.records.bag_metadata import VERSION, BagTopic
from stiction_ros.records.mcap_scan import McapScan, RawMessage

Wanted = Callable[[BagTopic], bool]


@dataclasses.dataclass(frozen=True, slots=True)
class BagMessage:
    """One decoded message.

    Attributes:
        topic: full topic name.
        type: ``sensor_msgs/msg/JointState``.
        log_time: when it was received, ns.
        publish_time: when it was sent, ns.
        message: its fields as attributes.
    """

    topic: str
    type: str
    log_time: int
    publish_time: int
    message: Any


def storage_files(path: str | Path) -> tuple[Path, ...]:
    """Return the MCAP files of a bag in their order.

    Args:
        path: a rosbag2 directory, finished or not, or one ``.mcap`` file.

    Raises:
        InputError: no such bag, a file of it missing, another storage, a newer version.
    """
    path = Path(path)
    where = str(path)
    if path.is_file():
        return (path,)
    if not path.is_dir():
        raise InputError("no such bag", where=where, fix="check the path")
    if (path / "metadata.yaml").is_file():
        return _listed_files(path)
    files = sorted(path.glob("*.mcap"), key=_number)
    if not files:
        raise InputError("holds no .mcap file", where=where, fix="give a rosbag2 directory")
    return tuple(files)


def read_raw(path: str | Path, notes: list[str] | None = None) -> Iterator[RawMessage]:
    """Yield every message of a bag as bytes, in the order it was written.

    Args:
        path: see :func:`storage_files`.
        notes: gets what was left out, one sentence each.

    Raises:
        InputError: no such bag, or damaged; complete messages before the damage come first.
    """
    for file in storage_files(path):
        scan = McapScan(file)
        yield from scan.messages()
        if notes is not None:
            notes.extend(scan.notes)


def read_messages(
    path: str | Path, *, wanted: Wanted | None = None, notes: list[str] | None = None
) -> Iterator[BagMessage]:
    """Yield the decoded messages of a bag in the order they were written.

    Args:
        path: see :func:`storage_files`.
        wanted: which topics to decode and yield; all when not given.
        notes: gets what was left out, one sentence each; topics that are not in CDR with
            ``ros2msg`` definitions are among them.

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
    """Decodes messages by the definitions that the bag carries.

    Attributes:
        notes: topics that could not be decoded, one sentence each.
    """

    def __init__(self) -> None:
        self.notes: list[str] = []
        self._factory = DecoderFactory()
        self._decoders: dict[BagTopic, Callable[[bytes], Any] | None] = {}

    def decode(self, raw: RawMessage, where: str) -> BagMessage | None:
        """Return the message; None when its topic has no definition to decode it by.

        Raises:
            InputError: its bytes do not fit the definition.
        """
        topic = raw.topic
        if topic not in self._decoders:
            self._decoders[topic] = self._decoder(topic)
        decoder = self._decoders[topic]
        if decoder is None:
            return None
        try:
            message = decoder(raw.data)
        except (struct.error, ValueError, IndexError, OverflowError, MemoryError, McapError) as e:
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
        try:
            decoder = self._factory.decoder_for(topic.encoding, schema)
        except Exception:  # any text may stand there and the parser's errors share no base
            decoder = None
        if decoder is None:
            self.notes.append(f"topic {topic.name} ({topic.type}) cannot be decoded, left out")
        return decoder


def last_part(topic: str) -> tuple[str, str]:
    """Return namespace and last part of a topic: ``/unit1/pv`` → ``/unit1``, ``pv``."""
    namespace, _, name = topic.rpartition("/")
    return namespace, name


def stamp_ns(message: Any) -> int:
    """Return the stamp of a message with a header, ns."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _listed_files(path: Path) -> tuple[Path, ...]:
    where = str(path / "metadata.yaml")
    try:
        text = (path / "metadata.yaml").read_text(encoding="utf-8")
        information = yaml.safe_load(text)["rosbag2_bagfile_information"]
        version = int(information["version"])
        storage = str(information["storage_identifier"])
        names = [str(name) for name in information["relative_file_paths"]]
    except (OSError, ValueError, TypeError, KeyError, yaml.YAMLError) as error:
        raise InputError(
            f"cannot be read ({type(error).__name__})", where=where, fix="make it anew by a reindex"
        ) from None
    if version > VERSION:
        raise InputError(f"has version {version}, newer than {VERSION}", where=where)
    if storage != "mcap" or information.get("compression_mode", "").lower() in ("file", "message"):
        raise InputError(
            f"the storage is {storage} {information.get('compression_mode', '')}".strip(),
            where=where,
            fix="convert it with `ros2 bag convert` to plain mcap",
        )
    files = tuple(path / Path(name).name for name in names)
    for file in files:
        if not file.is_file():
            raise InputError(f"{file.name} is missing", where=str(path), fix="put it back")
    if not files:
        raise InputError("lists no file", where=where)
    return files


def _number(path: Path) -> tuple[int, str]:
    """Sort ``bag_10.mcap`` after ``bag_9.mcap``."""
    found = re.search(r"_(\d+)$", path.stem)
    return (int(found[1]) if found else -1, path.name)
