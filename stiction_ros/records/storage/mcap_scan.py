"""Reads the records of one MCAP file from its beginning, whole, unfinished or damaged.

The readers of other packages want a finished file or give back the torn message at the end
of an unfinished one as if it were whole; this one gives back complete messages only. Every
checksum that the file carries is compared: of chunks, of the data, of the summary.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from stiction_ros.errors import InputError
from stiction_ros.records.storage.bag_metadata import BagTopic
from stiction_ros.records.storage.log_order import LogOrder, RawMessage
from stiction_ros.records.storage.mcap_format import (
    CHANNEL,
    CHUNK,
    DATA_END,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    METADATA,
    RECORD,
    SCHEMA,
    U16,
    U32,
    chunk_data,
    mapping_at,
    text_at,
)
from stiction_ros.records.storage.mcap_summary import (
    FOOTER_SIZE,
    SummaryError,
    has_footer,
    intact_summary,
    message_count,
)
from stiction_ros.records.storage.packed import SQLITE, conversion, opened

__all__ = ["BLOCK", "McapScan", "RawMessage"]

BLOCK = 1 << 20  # bytes read at a time
_HEADS = frozenset({0, CHUNK, DATA_END})  # records that the loop over the file looks at itself


class _DamageError(Exception):
    """A record that cannot be what it says; ``at`` is its place in the bytes looked at."""

    def __init__(self, why: str, at: int) -> None:
        super().__init__(why)
        self.at = at


class McapScan:
    """One pass over an MCAP file.

    Args:
        path: the file.
        salvage: pass over records that are damaged, with a note, instead of raising.

    Attributes:
        topics: channel id to topic, filled as :meth:`messages` goes on.
        counts: messages by channel id, as far as :meth:`messages` has come.
        metadata: name and content of every metadata record met so far.
        finished: whether it ends as a finished file does; False for a file whose writer
            was killed, or whose summary is damaged.
        notes: what was left out, one sentence each.
        damaged: whether there is a note on damage of the data, which only a salvage survives.
    """

    def __init__(self, path: Path, *, salvage: bool = False) -> None:
        self.path = path
        self.topics: dict[int, BagTopic] = {}
        self.counts: dict[int, int] = {}
        self.metadata: list[tuple[str, dict[str, str]]] = []
        self.finished = False
        self.damaged = False
        self.notes: list[str] = []
        self._salvage = salvage
        self._schemas: dict[int, tuple[str, str, str]] = {}

    def messages(self, *, by_log_time: bool = False) -> Iterator[RawMessage]:
        """Yield every complete message in the order of the file.

        Args:
            by_log_time: in the order of :class:`LogOrder` instead.

        Raises:
            InputError: no such file, not an MCAP file, or damaged inside; what is before the
                damage comes first.
        """
        try:
            with opened(self.path) as file:
                order = LogOrder.of(file) if by_log_time else LogOrder()
                try:
                    for messages, place in self._file(file):
                        yield from order.ready(messages, place)
                except InputError:
                    yield from order.rest()
                    raise
                yield from order.rest()
        except OSError as error:
            raise InputError(
                f"cannot be read ({error.strerror or error})", where=str(self.path)
            ) from None

    def _file(self, file: BinaryIO) -> Iterator[tuple[list[RawMessage], int]]:
        """Yield messages, and the place up to which the file was read."""
        first = file.read(len(MAGIC))
        if first and SQLITE.startswith(first):
            what = "is a bag of storage sqlite3"
            raise InputError(what, where=str(self.path), fix=conversion(self.path))
        if first != MAGIC:
            raise InputError(
                "is not an MCAP file",
                where=str(self.path),
                fix="give a rosbag2 directory or a .mcap file",
            )
        size = os.fstat(file.fileno()).st_size
        if self._salvage:
            self._learn_from_summary(file)
        place, checksum = len(MAGIC), zlib.crc32(MAGIC)  # of what comes before ``data``
        data, at = b"", 0
        while True:
            found: list[RawMessage] = []
            try:
                at = self._records(data, at, found)
            except _DamageError as damage:
                yield found, place + damage.at
                self._broken(place + damage.at, str(damage))
                at = _end(data, damage.at)
                continue
            if found:
                yield found, place + at
            opcode, length = _head(data, at)
            end = at + RECORD.size + length
            if opcode < 0 or end > len(data):  # the record goes on behind what was read
                if place + end > size or (opcode < 0 and place + len(data) >= size):
                    self._torn(file, size - place - at)
                    return
                checksum = zlib.crc32(memoryview(data)[:at], checksum)
                place += at
                more = file.read(max(BLOCK, end - len(data)))
                data, at = data[at:] + more, 0
                if not more:  # it was cut while it was read
                    self._torn(file, len(data))
                    return
            elif opcode == CHUNK:
                found, fault = [], ""
                try:
                    self._chunk(data[at + RECORD.size : end], found)
                except (_DamageError, ValueError, struct.error) as error:
                    fault = str(error)
                yield found, place + end
                if fault:
                    self._broken(place + at, fault)
                at = end
            elif opcode == DATA_END:
                checksum = zlib.crc32(memoryview(data)[:at], checksum)
                rest = data[end:] + file.read()
                self._end_of_data(data[at + RECORD.size : end], checksum, rest, place + end)
                return
            else:  # opcode 0, as in blocks that a file system has not filled
                self._torn(file, size - place - at)
                return

    def _records(self, data: bytes, at: int, found: list[RawMessage]) -> int:
        """Append the messages from ``at`` on; return where a record of another kind begins."""
        topics, counts, size = self.topics, self.counts, len(data)
        try:
            while at + RECORD.size <= size:
                opcode, length = RECORD.unpack_from(data, at)
                body = at + RECORD.size
                end = body + length
                if end > size or opcode in _HEADS:
                    break
                if opcode == MESSAGE:
                    channel, _, log_time, publish_time = MESSAGE_HEAD.unpack_from(data, body)
                    start = body + MESSAGE_HEAD.size
                    if channel not in topics or start > end:
                        raise ValueError(f"a message of channel {channel} that is not known")
                    counts[channel] += 1
                    found.append(
                        RawMessage(topics[channel], log_time, publish_time, data[start:end])
                    )
                else:
                    self._other(opcode, data[body:end])
                at = end
        except (struct.error, ValueError) as error:
            raise _DamageError(str(error), at) from error
        return at

    def _chunk(self, body: bytes, found: list[RawMessage]) -> None:
        data, checksum = chunk_data(body)
        if checksum and zlib.crc32(data) != checksum:
            raise ValueError("a chunk's checksum is wrong")
        end = self._records(data, 0, found)
        if end != len(data):
            raise ValueError("a record is longer than its chunk")

    def _other(self, opcode: int, body: bytes) -> None:
        if opcode == SCHEMA:
            (key,) = U16.unpack_from(body)
            name, at = text_at(body, 2)
            encoding, at = text_at(body, at)
            definition, _ = text_at(body, at)
            self._schemas[key] = (name, encoding, definition)
        elif opcode == CHANNEL:
            key, topic = self._channel(body)
            self.topics[key] = topic
            self.counts.setdefault(key, 0)
        elif opcode == METADATA:
            name, at = text_at(body, 0)
            self.metadata.append((name, mapping_at(body, at)))

    def _channel(self, body: bytes) -> tuple[int, BagTopic]:
        key, schema = struct.unpack_from("<HH", body)
        topic, at = text_at(body, 4)
        encoding, at = text_at(body, at)
        metadata = mapping_at(body, at)
        name, schema_encoding, definition = self._schemas.get(schema, ("", "", ""))
        return key, BagTopic(
            name=topic,
            type=name,
            definition=definition,
            type_hash=metadata.get("topic_type_hash", ""),
            qos_yaml=metadata.get("offered_qos_profiles", ""),
            encoding=encoding,
            schema_encoding=schema_encoding,
        )

    def _learn_from_summary(self, file: BinaryIO) -> None:
        """Take topics from an intact summary: the chunk that announces them may be damaged."""
        for opcode, body in intact_summary(file):
            if opcode in (SCHEMA, CHANNEL):
                self._other(opcode, body)
        file.seek(len(MAGIC))

    def _end_of_data(self, body: bytes, checksum: int, rest: bytes, place: int) -> None:
        """Compare checksum and summary, which begins at ``place``, with what was read."""
        self.finished = True
        if self.damaged:  # of what was left out nothing more can be said
            return
        expected = U32.unpack_from(body)[0] if len(body) >= U32.size else 0
        if expected and expected != checksum:
            self._broken(place, "the checksum of the data is wrong")
            return
        found = sum(self.counts.values())
        try:
            told = message_count(rest)
            fault = "" if told in (None, found) else f"it says {told} messages, there are {found}"
            if fault and not expected:
                self._broken(place, f"summary: {fault}")
                return
        except SummaryError as error:
            fault = str(error)
        if fault:
            self.finished = False
            self.notes.append(f"the summary of {self.path.name} is damaged ({fault}), not its data")

    def _torn(self, file: BinaryIO, left: int) -> None:
        """Note an unfinished file; raise when the file had been finished."""
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - FOOTER_SIZE, 0))
        tail = file.read()
        if has_footer(tail):
            self._broken(size - left, "a record is longer than the file")
            return
        more = f", its last {left} bytes are no whole record and are left out" if left else ""
        self.notes.append(f"{self.path.name} was not closed by its writer{more}")

    def _broken(self, place: int, why: str) -> None:
        """Raise, or when salvaging note, that a record is damaged."""
        if not self._salvage:
            raise InputError(
                f"is damaged near byte {place} ({why})",
                where=str(self.path),
                fix="save what is whole with `stiction repair`",
            )
        self.damaged = True
        self.notes.append(f"{self.path.name} is damaged near byte {place} ({why})")


def _head(data: bytes, at: int) -> tuple[int, int]:
    """Return opcode and length of the record at ``at``; opcode -1 when they are cut off."""
    if at + RECORD.size > len(data):
        return -1, 0
    opcode, length = RECORD.unpack_from(data, at)
    return opcode, length


def _end(data: bytes, at: int) -> int:
    return at + RECORD.size + _head(data, at)[1]
