"""Writes a finished MCAP file: chunked, compressed, indexed, with every checksum.

``mcap.writer.Writer`` does the same with an object for each message, which takes 2 to 5 times as
long, and a recorder finishes its bag while others still control.
"""

from __future__ import annotations

import itertools
import struct
import sys
import zlib
from array import array
from collections.abc import Mapping
from typing import BinaryIO

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from stiction_ros.errors import InputError
from stiction_ros.records.storage.bag_metadata import BagTopic
from stiction_ros.records.storage.mcap_format import (
    CHUNK,
    FOOTER,
    FOOTER_BODY,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    MESSAGE_RECORD,
    RECORD,
    U16,
    U32,
    U64,
    packed_text,
    record,
)

COMPRESSIONS = ("zstd", "lz4", "none")

_TIMES_AND_SIZE = struct.Struct("<QQQI")


class ChunkedFile:
    """An MCAP file in the making.

    Args:
        output: where it goes, empty, opened for writing bytes.
        compression: ``zstd``, ``lz4`` or ``none``.
        chunk_size: bytes of records in one chunk before compression.

    Attributes:
        counts: messages by channel.

    Raises:
        InputError: another compression.
    """

    def __init__(
        self, output: BinaryIO, *, compression: str = "zstd", chunk_size: int = 1 << 18
    ) -> None:
        if compression not in COMPRESSIONS:
            raise InputError(
                f"compression {compression!r} is not known", fix=f"use {', '.join(COMPRESSIONS)}"
            )
        self.counts: dict[int, int] = {}
        self._first: int | None = None
        self._last: int | None = None
        self._output = output
        self._compression = compression
        self._chunk_size = chunk_size
        self._position = 0
        self._checksum = 0
        self._schemas: dict[tuple[str, str, str], Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._metadata: list[MetadataIndex] = []
        self._chunks: list[ChunkIndex] = []
        self._begin_chunk()
        self._emit(MAGIC + _bytes(Header(profile="ros2", library="stiction_ros")))

    def topic(self, topic: BagTopic) -> int:
        """Add a topic and return its channel."""
        key = (topic.type, topic.schema_encoding, topic.definition)
        if key not in self._schemas:
            schema = Schema(
                len(self._schemas) + 1,
                topic.definition.encode(),
                topic.schema_encoding,
                topic.type,
            )
            self._schemas[key] = schema
            self._chunk += _bytes(schema)
        number = len(self._channels) + 1
        channel = Channel(
            number, topic.name, topic.encoding, topic.channel_metadata(), self._schemas[key].id
        )
        self._channels[number] = channel
        self.counts[number] = 0
        self._chunk += _bytes(channel)
        return number

    def message(self, channel: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Add one message, times in ns."""
        count = self.counts[channel]
        chunk = self._chunk
        offset = len(chunk)
        chunk += MESSAGE_RECORD.pack(
            MESSAGE,
            MESSAGE_HEAD.size + len(data),
            channel,
            count & 0xFFFFFFFF,
            log_time,
            publish_time,
        )
        chunk += data
        self.counts[channel] = count + 1
        index = self._index.get(channel)
        if index is None:
            index = self._index[channel] = array("Q")
        index.append(log_time)
        index.append(offset)
        if len(chunk) >= self._chunk_size:
            self._end_chunk()

    def metadata(self, name: str, mapping: Mapping[str, str]) -> None:
        """Add a metadata record."""
        self._end_chunk()
        data = _bytes(Metadata(metadata=dict(mapping), name=name))
        self._metadata.append(MetadataIndex(length=len(data), name=name, offset=self._position))
        self._emit(data)

    def span(self) -> tuple[int | None, int | None]:
        """Return the lowest and the highest log time so far, ns; None without messages."""
        self._end_chunk()
        return self._first, self._last

    def finish(self) -> None:
        """Write what is left, the summary and the footer; nothing may follow."""
        self._end_chunk()
        self._emit(_bytes(DataEnd(self._checksum)))
        start = self._position
        summary, offsets = bytearray(), bytearray()
        for group in self._groups():
            data = b"".join(_bytes(entry) for entry in group)
            if data:
                offset = SummaryOffset(
                    group_opcode=data[0],
                    group_start=start + len(summary),
                    group_length=len(data),
                )
                offsets += _bytes(offset)
                summary += data
        offset_start = start + len(summary)
        summary += offsets
        head = struct.pack("<BQQQ", FOOTER, FOOTER_BODY.size, start, offset_start)
        self._output.write(summary)
        self._output.write(head + U32.pack(zlib.crc32(head, zlib.crc32(summary))) + MAGIC)

    def _groups(self) -> list[list[McapRecord]]:
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts={key: n for key, n in self.counts.items() if n},
            chunk_count=len(self._chunks),
            message_count=sum(self.counts.values()),
            message_end_time=self._last or 0,
            message_start_time=self._first or 0,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        return [
            list(self._schemas.values()),
            list(self._channels.values()),
            [statistics],
            list(self._chunks),
            list(self._metadata),
        ]

    def _begin_chunk(self) -> None:
        self._chunk = bytearray()
        self._index: dict[int, array[int]] = {}

    def _end_chunk(self) -> None:
        """Write the chunk and the index of its messages, by channel."""
        if not self._chunk:
            return
        data = bytes(self._chunk)
        first, last = self._times()
        name = "" if self._compression == "none" else self._compression
        packed = _packed(data, self._compression)
        head = _TIMES_AND_SIZE.pack(first, last, len(data), zlib.crc32(data))
        body = head + packed_text(name) + U64.pack(len(packed)) + packed
        start = self._position
        self._emit(RECORD.pack(CHUNK, len(body)), body)
        end = self._position
        offsets = {}
        for channel, index in sorted(self._index.items()):
            offsets[channel] = self._position
            if sys.byteorder == "big":
                index.byteswap()
            entries = index.tobytes()
            self._emit(record(MESSAGE_INDEX, U16.pack(channel) + U32.pack(len(entries)) + entries))
        self._chunks.append(
            ChunkIndex(
                chunk_length=end - start,
                chunk_start_offset=start,
                compression=name,
                compressed_size=len(packed),
                message_end_time=last,
                message_index_length=self._position - end,
                message_index_offsets=offsets,
                message_start_time=first,
                uncompressed_size=len(data),
            )
        )
        self._begin_chunk()

    def _times(self) -> tuple[int, int]:
        """Return the lowest and highest log time of the chunk, and widen the file's."""
        if not self._index:
            return 0, 0
        times = [index[::2] for index in self._index.values()]
        first = min(itertools.chain.from_iterable(times))
        last = max(itertools.chain.from_iterable(times))
        self._first = first if self._first is None else min(self._first, first)
        self._last = last if self._last is None else max(self._last, last)
        return first, last

    def _emit(self, *parts: bytes) -> None:
        for part in parts:
            self._output.write(part)
            self._checksum = zlib.crc32(part, self._checksum)
            self._position += len(part)


def _bytes(entry: McapRecord) -> bytes:
    builder = RecordBuilder()
    entry.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def _packed(data: bytes, compression: str) -> bytes:
    if compression == "zstd":
        return zstandard.ZstdCompressor().compress(data)
    if compression == "lz4":
        return bytes(lz4.frame.compress(data))
    return data
