"""Messages of an MCAP file by their log time, held no longer than they must be."""

from __future__ import annotations

import bisect
import itertools
import os
import struct
from array import array
from collections.abc import Iterator, Sequence
from operator import attrgetter
from typing import BinaryIO, NamedTuple

from stiction_ros.records.storage.bag_metadata import BagTopic
from stiction_ros.records.storage.mcap_format import CHUNK, DATA_END, MAGIC, MESSAGE, RECORD, U64
from stiction_ros.records.storage.mcap_summary import FOOTER_SIZE, has_footer

_LOG_TIME = {CHUNK: RECORD.size, MESSAGE: RECORD.size + struct.calcsize("<HI")}
"""Where the first log time of a chunk, and that of a message, stands in its record."""

_LATEST = 2**64 - 1
_time = attrgetter("log_time")


class RawMessage(NamedTuple):
    """One message as bytes: its topic, log and publish time in ns, serialised data."""

    topic: BagTopic
    log_time: int
    publish_time: int
    data: bytes


class LogOrder:
    """Gives out each message when no earlier one can come; of one log time, as in the file.

    A chunk tells its first log time before its messages, so that only those of chunks that
    overlap are held.

    Args:
        places: of the chunks, and of the messages outside of chunks, in a file.
        times: first log time in each of them, ns; without any, messages keep their order.
    """

    def __init__(self, places: Sequence[int] = (), times: Sequence[int] = ()) -> None:
        self._places = places
        self._least = array("Q", itertools.accumulate(reversed(times), min))
        self._least.reverse()
        self._held: list[RawMessage] = []
        self._first = _LATEST

    @classmethod
    def of(cls, file: BinaryIO) -> LogOrder:
        """Return the order of a file, which is at its beginning and is left there.

        A journal, without chunks and never closed, keeps the order in which it was written:
        its log times are of the wall until simulated time is known, and never out of order.
        """
        places, times, chunked = array("Q"), array("Q"), False
        for place, opcode, time in _heads(file):
            places.append(place)
            times.append(time)
            chunked |= opcode == CHUNK
        file.seek(max(file.seek(0, os.SEEK_END) - FOOTER_SIZE, 0))
        closed = has_footer(file.read())
        file.seek(0)
        return cls(places, times) if chunked or closed else cls()

    def ready(self, messages: list[RawMessage], place: int) -> list[RawMessage]:
        """Take what was read up to ``place`` of the file; return what may be given out."""
        if not self._places:
            return messages
        following = bisect.bisect_left(self._places, place)
        self._first = min(self._first, min(map(_time, messages), default=self._first))
        self._held += messages
        if following == len(self._least) or self._first > self._least[following]:
            return []
        self._held.sort(key=_time)
        count = bisect.bisect_right(self._held, self._least[following], key=_time)
        given, self._held = self._held[:count], self._held[count:]
        self._first = self._held[0].log_time if self._held else _LATEST
        return given

    def rest(self) -> list[RawMessage]:
        """Return what is held, when nothing more comes."""
        return sorted(self._held, key=_time)


def _heads(file: BinaryIO) -> Iterator[tuple[int, int, int]]:
    """Yield place, opcode and first log time of each chunk, and of each message outside."""
    size = file.seek(0, os.SEEK_END)
    place = len(MAGIC)
    longest = max(_LOG_TIME.values()) + U64.size
    while place + longest <= size:
        file.seek(place)
        head = file.read(longest)
        opcode, length = RECORD.unpack_from(head)
        if opcode in (0, DATA_END):
            return
        if opcode in _LOG_TIME:
            yield place, opcode, U64.unpack_from(head, _LOG_TIME[opcode])[0]
        place += RECORD.size + length
