"""Writes a rosbag2 directory that survives the death of its writer.

While it runs, ``<dir>_0.mcap`` is a journal: every message is one unchunked record, handed
to the operating system before :meth:`BagWriter.write` returns, so that a killed process
loses nothing that it had written. :meth:`BagWriter.close` lets :func:`finish_bag` rewrite
the journal chunked, compressed and indexed and adds ``metadata.yaml``; the same function
repairs the bag of a writer that was killed.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Protocol

from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Header, Metadata, Schema

from stiction_ros.errors import InputError
from stiction_ros.records.bag_finish import finish_bag, storage_path
from stiction_ros.records.bag_metadata import (
    BagFile,
    BagTopic,
    Qos,
    bag_information,
    metadata_record,
    qos_yaml,
)
from stiction_ros.records.mcap_scan import MAGIC, MESSAGE

__all__ = ["BagWriter", "Qos"]

_MESSAGE = struct.Struct("<BQHIQQ")
_HEAD = 22


class _Entry:
    """What :meth:`BagWriter.write` needs of a topic."""

    __slots__ = ("channel", "count", "topic")

    def __init__(self, channel: int, topic: BagTopic) -> None:
        self.channel = channel
        self.topic = topic
        self.count = 0


class _Writable(Protocol):
    def write(self, stream: RecordBuilder, /) -> None: ...


class BagWriter:
    """A rosbag2 bag (MCAP storage) being written; also a context manager.

    Args:
        directory: the bag; made with its parents, must not hold anything yet.
        compression: of the finished bag: ``zstd``, ``lz4`` or ``none``.
        chunk_size: bytes of messages in one chunk of the finished bag.

    One thread writes. Times are integers in nanoseconds.

    Raises:
        InputError: the directory holds something already.
    """

    def __init__(
        self, directory: str | Path, *, compression: str = "zstd", chunk_size: int = 1 << 20
    ) -> None:
        self.directory = Path(directory)
        self._compression = compression
        self._chunk_size = chunk_size
        self._entries: dict[str, _Entry] = {}
        self._schemas: dict[tuple[str, str], int] = {}
        self._closed = False
        _make_empty(self.directory)
        path = storage_path(self.directory)
        self._file = path.open("xb")
        self._file.write(MAGIC)
        self._put(Header(profile="ros2", library="stiction_ros"))
        start = bag_information(BagFile(path.name, {}, None, None), [])
        self.add_metadata("rosbag2", metadata_record(start))

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by topic."""
        return {name: entry.count for name, entry in self._entries.items()}

    def add_topic(
        self,
        name: str,
        type: str,
        definition_text: str,
        type_hash: str,
        qos: Qos | Iterable[Qos] = Qos(),  # noqa: B008 (frozen)
    ) -> None:
        """Announce a topic before its first message.

        Args:
            name: full topic name.
            type: ``sensor_msgs/msg/JointState``.
            definition_text: definition with dependencies, see :func:`definition`.
            type_hash: ``RIHS01_…`` or empty.
            qos: what its publishers offer, one profile or one for each.

        Raises:
            InputError: the topic is there already with another type.
        """
        self._open()
        profiles = (qos,) if isinstance(qos, Qos) else tuple(qos)
        topic = BagTopic(name, type, definition_text, type_hash, qos_yaml(profiles))
        if name in self._entries:
            known = self._entries[name].topic
            if known.type == type:
                return
            raise InputError(
                f"topic {name} is recorded as {known.type} and cannot also be {type}",
                where=str(self.directory),
            )
        key = (type, definition_text)
        if key not in self._schemas:
            self._schemas[key] = len(self._schemas) + 1
            data = definition_text.encode()
            self._put(Schema(self._schemas[key], data, "ros2msg", type))
        entry = _Entry(len(self._entries) + 1, topic)
        metadata = topic.channel_metadata()
        self._put(Channel(entry.channel, name, "cdr", metadata, self._schemas[key]))
        self._entries[name] = entry

    def write(self, topic: str, data: bytes, log_time: int, publish_time: int) -> None:
        """Write one serialised message (CDR); it is safe from a kill when this returns.

        Args:
            topic: a name given to :meth:`add_topic`.
            data: the bytes of a raw subscription.
            log_time: when it was received, ns; simulated time when there is a clock.
            publish_time: when it was sent, ns.

        Raises:
            InputError: a topic that was not announced.
            OSError: the storage refuses, a full disk for example.
        """
        try:
            entry = self._entries[topic]
        except KeyError:
            raise InputError(f"topic {topic} was not added", where=str(self.directory)) from None
        head = _MESSAGE.pack(
            MESSAGE,
            _HEAD + len(data),
            entry.channel,
            entry.count & 0xFFFFFFFF,
            log_time,
            publish_time,
        )
        self._file.write(head + data)
        self._file.flush()
        entry.count += 1

    def add_metadata(self, name: str, mapping: Mapping[str, str]) -> None:
        """Add a metadata record, such as the run's configuration."""
        self._open()
        self._put(Metadata(metadata=dict(mapping), name=name))

    def close(self) -> None:
        """Finish the bag; a second call does nothing."""
        if self._closed:
            return
        self._closed = True
        self._file.close()
        finish_bag(self.directory, compression=self._compression, chunk_size=self._chunk_size)

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _open(self) -> None:
        if self._closed:
            raise InputError("the bag is closed", where=str(self.directory))

    def _put(self, record: _Writable) -> None:
        builder = RecordBuilder()
        record.write(builder)
        self._file.write(builder.end())  # type: ignore[no-untyped-call]
        self._file.flush()


def _make_empty(directory: Path) -> None:
    where = str(directory)
    fix = "choose another place or move it away"
    try:
        directory.mkdir(parents=True, exist_ok=True)
        full = next(directory.iterdir(), None) is not None
    except FileExistsError:
        raise InputError("is a file, a bag is a directory", where=where, fix=fix) from None
    except OSError as error:
        raise InputError(f"cannot be made ({error.strerror})", where=where) from None
    if full:
        raise InputError("exists and is not empty", where=where, fix=fix)
