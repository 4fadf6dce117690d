"""The end of a finished MCAP file: what its summary says, when it can be believed."""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator
from typing import BinaryIO

from stiction_ros.records.storage.mcap_format import (
    FOOTER,
    FOOTER_BODY,
    MAGIC,
    RECORD,
    STATISTICS,
    U32,
    U64,
)

FOOTER_HEAD = RECORD.pack(FOOTER, FOOTER_BODY.size)
FOOTER_SIZE = len(FOOTER_HEAD) + FOOTER_BODY.size + len(MAGIC)
"""Bytes of the footer with the magic behind it."""


class SummaryError(Exception):
    """A summary that cannot be believed; the text says why."""


def has_footer(tail: bytes) -> bool:
    """Tell whether the last :data:`FOOTER_SIZE` bytes of a file are those of a finished one."""
    return tail.startswith(FOOTER_HEAD) and tail.endswith(MAGIC)


def summary_records(rest: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of the records of a summary, its checksum compared.

    Args:
        rest: everything behind the end of the data, to the end of the file.

    Raises:
        SummaryError: no footer, a wrong checksum, or a record that is too long.
    """
    if not has_footer(rest[-FOOTER_SIZE:]):
        raise SummaryError("no footer at its end")
    protected = memoryview(rest)[: -len(MAGIC) - U32.size]
    (checksum,) = U32.unpack_from(rest, len(protected))
    if checksum and zlib.crc32(protected) != checksum:
        raise SummaryError("the checksum of the summary is wrong")
    at, end = 0, len(rest) - FOOTER_SIZE
    while at + RECORD.size <= end:
        opcode, length = RECORD.unpack_from(rest, at)
        at += RECORD.size
        if length > end - at:
            raise SummaryError("a record is longer than the summary")
        yield opcode, rest[at : at + length]
        at += length


def message_count(rest: bytes) -> int | None:
    """Return the number of messages that a summary tells; None when it does not.

    Args:
        rest: as for :func:`summary_records`.

    Raises:
        SummaryError: the summary is damaged.
    """
    for opcode, body in summary_records(rest):
        if opcode == STATISTICS and len(body) >= U64.size:
            return int(U64.unpack_from(body)[0])
    return None


def intact_summary(file: BinaryIO) -> list[tuple[int, bytes]]:
    """Return the records of a file's summary; none when it has none or it is damaged."""
    size = file.seek(0, os.SEEK_END)
    if size < FOOTER_SIZE:
        return []
    file.seek(size - FOOTER_SIZE)
    tail = file.read()
    start, _, checksum = FOOTER_BODY.unpack_from(tail, len(FOOTER_HEAD))
    if not has_footer(tail) or not checksum or not 0 < start < size:
        return []
    file.seek(start)
    try:
        return list(summary_records(file.read()))
    except SummaryError:
        return []
