"""The records of an MCAP file, byte by byte, as far as bags need them."""

from __future__ import annotations

import struct

import lz4.frame  # type: ignore[import-untyped]
import zstandard

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = 1, 2, 3, 4, 5, 6, 7
STATISTICS, METADATA, DATA_END = 0x0B, 0x0C, 0x0F

RECORD = struct.Struct("<BQ")
"""Opcode and length of the content, before every record."""

MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time, before the data of a message."""

MESSAGE_RECORD = struct.Struct("<BQHIQQ")
"""The head of a message record and what comes before its data, in one."""

FOOTER_BODY = struct.Struct("<QQI")
"""Start of the summary, start of its offsets, its checksum."""

CHUNK_TIMES = struct.Struct("<QQ")
"""First and last log time of a chunk, at its beginning."""

U16 = struct.Struct("<H")
U32 = struct.Struct("<I")
U64 = struct.Struct("<Q")

_CHUNK = struct.Struct("<QQQI")
_LARGEST_CHUNK = 2**31


def text_at(body: bytes, at: int) -> tuple[str, int]:
    """Return the string at ``at`` and the place after it.

    Raises:
        ValueError: it is longer than the record, or no UTF-8.
    """
    (length,) = U32.unpack_from(body, at)
    end = at + 4 + length
    if end > len(body):
        raise ValueError("a text is longer than its record")
    return body[at + 4 : end].decode(), end


def mapping_at(body: bytes, at: int) -> dict[str, str]:
    """Return the map of strings at ``at``; ValueError as for :func:`text_at`."""
    (length,) = U32.unpack_from(body, at)
    at += 4
    end = at + length
    values: dict[str, str] = {}
    while at < end:
        key, at = text_at(body, at)
        values[key], at = text_at(body, at)
    return values


def packed_text(text: str) -> bytes:
    """Return a string with its length before it."""
    data = text.encode()
    return U32.pack(len(data)) + data


def record(opcode: int, body: bytes) -> bytes:
    """Return a record with its head."""
    return RECORD.pack(opcode, len(body)) + body


def chunk_data(body: bytes) -> tuple[bytes, int]:
    """Return the records in a chunk, and its checksum (0 for none).

    Args:
        body: content of the chunk record.

    Raises:
        ValueError: the sizes in it contradict each other, or it cannot be decompressed.
        struct.error: it is cut short.
    """
    _, _, size, checksum = _CHUNK.unpack_from(body)
    compression, at = text_at(body, _CHUNK.size)
    (length,) = U64.unpack_from(body, at)
    packed = body[at + 8 : at + 8 + length]
    if len(packed) != length or size > _LARGEST_CHUNK:
        raise ValueError("a chunk's size is wrong")
    data = _unpacked(packed, compression, size)
    if len(data) != size:
        raise ValueError("a chunk's size is wrong")
    return data, checksum


def _unpacked(data: bytes, compression: str, size: int) -> bytes:
    """Return what was compressed; never more memory than ``size`` says."""
    if compression == "":
        return data
    if compression == "zstd":
        try:
            if zstandard.frame_content_size(data) not in (-1, size):
                raise ValueError("a chunk's size is wrong")
            return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
        except zstandard.ZstdError as error:
            raise ValueError(str(error)) from error
    if compression == "lz4":
        try:
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size))
        except (RuntimeError, EOFError) as error:
            raise ValueError(str(error)) from error
    raise ValueError(f"compression {compression!r} is not known")
