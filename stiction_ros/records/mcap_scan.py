"""Reads the records of one MCAP file from its beginning, whole, unfinished or damaged.

The readers of other packages want a finished file or give back the torn message at the end
of an unfinished one as if it were whole; this one gives back complete messages only.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import zstandard

from stiction_ros.errors import InputError
from stiction_ros.records.bag_metadata import BagTopic

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 1, 2, 3, 4, 5, 6
STATISTICS, METADATA, DATA_END = 0x0B, 0x0C, 0x0F
_LARGEST_CHUNK = 2**31

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQI")
_FOOTER_HEAD = _RECORD.pack(FOOTER, 20)
_FOOTER_SIZE = len(_FOOTER_HEAD) + 20 + len(MAGIC)
_U16 = struct.Struct("<H")
_U32 = struct.Struct("<I")
_U64 = struct.Struct("<Q")


class RawMessage(NamedTuple):
    """One message as bytes: its topic, log and publish time in ns, serialised data."""

    topic: BagTopic
    log_time: int
    publish_time: int
    data: bytes


class McapScan:
    """One pass over an MCAP file.

    Args:
        path: the file.

    Attributes:
        topics: channel id to topic, filled as :meth:`messages` goes on.
        metadata: name and content of every metadata record met so far.
        finished: whether the end of the data was reached; False for a file whose writer
            was killed.
        notes: what was left out, one sentence each.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[int, BagTopic] = {}
        self.metadata: list[tuple[str, dict[str, str]]] = []
        self.finished = False
        self.notes: list[str] = []
        self._schemas: dict[int, tuple[str, str, str]] = {}
        self._count = 0

    def messages(self) -> Iterator[RawMessage]:
        """Yield every complete message in the order of the file.

        Raises:
            InputError: no such file, not an MCAP file, or damaged inside.
        """
        try:
            with self.path.open("rb") as file:
                yield from self._messages(file)
        except OSError as error:
            raise InputError(
                f"cannot be read ({error.strerror or error})", where=str(self.path)
            ) from None

    def _messages(self, file: BinaryIO) -> Iterator[RawMessage]:
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError(
                "is not an MCAP file",
                where=str(self.path),
                fix="give a rosbag2 directory or a .mcap file",
            )
        size = os.fstat(file.fileno()).st_size
        position = len(MAGIC)
        checksum = zlib.crc32(MAGIC)
        while True:
            head = file.read(_RECORD.size)
            opcode, length = _RECORD.unpack(head) if len(head) == _RECORD.size else (0, 0)
            if opcode == 0 or length > size - position - _RECORD.size:
                self._torn(file, size - position)
                return
            body = file.read(length)
            if opcode == DATA_END:
                self._end_of_data(file, body, checksum, size)
                return
            checksum = zlib.crc32(body, zlib.crc32(head, checksum))
            try:
                if opcode == CHUNK:
                    yield from self._chunk(body)
                elif opcode == MESSAGE:
                    yield self._message(body)
                else:
                    self._other(opcode, body)
            except (struct.error, KeyError, ValueError, RuntimeError, zstandard.ZstdError) as error:
                if isinstance(error, InputError):
                    raise
                raise self._damaged(position, str(error)) from error
            position += _RECORD.size + length

    def _message(self, body: bytes) -> RawMessage:
        channel, _, log_time, publish_time = _MESSAGE.unpack_from(body)
        self._count += 1
        return RawMessage(self.topics[channel], log_time, publish_time, body[_MESSAGE.size :])

    def _chunk(self, body: bytes) -> Iterator[RawMessage]:
        _, _, size, checksum = _CHUNK.unpack_from(body)
        compression, at = _text(body, _CHUNK.size)
        (length,) = _U64.unpack_from(body, at)
        packed = body[at + 8 : at + 8 + length]
        if len(packed) != length or size > _LARGEST_CHUNK:
            raise ValueError("a chunk's size is wrong")
        data = _unpacked(packed, compression, size)
        if len(data) != size or (checksum and zlib.crc32(data) != checksum):
            raise ValueError("a chunk's checksum is wrong")
        at = 0
        while at < size:
            opcode, length = _RECORD.unpack_from(data, at)
            at += _RECORD.size
            if length > size - at:
                raise ValueError("a record is longer than its chunk")
            record = data[at : at + length]
            if opcode == MESSAGE:
                yield self._message(record)
            else:
                self._other(opcode, record)
            at += length

    def _other(self, opcode: int, body: bytes) -> None:
        if opcode == SCHEMA:
            (key,) = _U16.unpack_from(body)
            name, at = _text(body, 2)
            encoding, at = _text(body, at)
            definition, _ = _text(body, at)
            self._schemas[key] = (name, encoding, definition)
        elif opcode == CHANNEL:
            key, schema = struct.unpack_from("<HH", body)
            topic, at = _text(body, 4)
            encoding, at = _text(body, at)
            metadata = _mapping(body, at)
            name, schema_encoding, definition = self._schemas.get(schema, ("", "", ""))
            self.topics[key] = BagTopic(
                name=topic,
                type=name,
                definition=definition,
                type_hash=metadata.get("topic_type_hash", ""),
                qos_yaml=metadata.get("offered_qos_profiles", ""),
                encoding=encoding,
                schema_encoding=schema_encoding,
            )
        elif opcode == METADATA:
            name, at = _text(body, 0)
            self.metadata.append((name, _mapping(body, at)))

    def _end_of_data(self, file: BinaryIO, body: bytes, checksum: int, size: int) -> None:
        self.finished = True
        (expected,) = _U32.unpack_from(body)
        if expected and expected != checksum:
            raise self._damaged(file.tell(), "the checksum of the data is wrong")
        while len(head := file.read(_RECORD.size)) == _RECORD.size:
            opcode, length = _RECORD.unpack(head)
            if opcode == FOOTER or length > size:
                return
            summary = file.read(length)
            if opcode == STATISTICS and len(summary) >= 8:
                (count,) = _U64.unpack_from(summary)
                if count != self._count:
                    raise self._damaged(
                        file.tell(), f"it holds {self._count} messages, its summary says {count}"
                    )

    def _torn(self, file: BinaryIO, left: int) -> None:
        """Note an unfinished file; raise when the file had been finished."""
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - _FOOTER_SIZE, 0))
        end = file.read()
        if end.startswith(_FOOTER_HEAD) and end.endswith(MAGIC):
            raise self._damaged(size - left, "a record is longer than the file")
        tail = f", its last {left} bytes are no whole record and are left out" if left else ""
        self.notes.append(f"{self.path.name} was not closed by its writer{tail}")

    def _damaged(self, position: int, why: str) -> InputError:
        return InputError(f"is damaged near byte {position} ({why})", where=str(self.path))


def _unpacked(data: bytes, compression: str, size: int) -> bytes:
    if compression == "zstd":
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    if compression == "lz4":
        return bytes(lz4.frame.decompress(data))
    if compression == "":
        return data
    raise ValueError(f"compression {compression!r} is not known")


def _text(body: bytes, at: int) -> tuple[str, int]:
    """Return the string at ``at`` and the place after it."""
    (length,) = _U32.unpack_from(body, at)
    end = at + 4 + length
    if end > len(body):
        raise ValueError("a text is longer than its record")
    return body[at + 4 : end].decode(), end


def _mapping(body: bytes, at: int) -> dict[str, str]:
    (length,) = _U32.unpack_from(body, at)
    at += 4
    end = at + length
    values: dict[str, str] = {}
    while at < end:
        key, at = _text(body, at)
        values[key], at = _text(body, at)
    return values
