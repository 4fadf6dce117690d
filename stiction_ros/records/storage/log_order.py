"""Messages of an MCAP file by their log time, held no longer than they must be."""

from __future__ import annotations

import bisect
import itertools
import os
from array import array
from collections.abc import Iterable, Iterator, Sequence
from operator import itemgetter
from typing import BinaryIO, NamedTuple

from stiction_ros.records.storage.bag_metadata import BagTopic
from stiction_ros.records.storage.log_time import AGAIN
from stiction_ros.records.storage.mcap_format import (
    CHUNK,
    CHUNK_TIMES,
    DATA_END,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    RECORD,
)
from stiction_ros.records.storage.mcap_summary import FOOTER_SIZE, has_footer

_log_time = itemgetter(1)


class RawMessage(NamedTuple):
    """One message as bytes: its topic, log and publish time in ns, serialised data."""

    topic: BagTopic
    log_time: int
    publish_time: int
    data: bytes


class LogOrder:
    """Gives out messages by log time, those of one log time as they stand in the file.

    Chunks tell their times before their messages: those that overlap are held, others are not.

    Args:
        places: of the chunks, and of the messages outside of chunks, in a file.
        first, last: log times of each of them, ns; without any, messages keep their order.
    """

    def __init__(
        self,
        places: Sequence[int] = (),
        first: Sequence[int] = (),
        last: Iterable[int] = (),
    ) -> None:
        self._places = places
        self._least = array("Q", itertools.accumulate(reversed(first), min))[::-1]
        self._most = array("Q", itertools.accumulate(last, max))
        self._held: list[RawMessage] = []

    @classmethod
    def of(cls, file: BinaryIO) -> LogOrder:
        """Return the order of a file, which is at its beginning and is left there.

        A journal, without chunks and never closed, keeps the order in which it was written:
        its log times are of the wall until simulated time is known, and never out of order.
        """
        places, first, last, chunked = array("Q"), array("Q"), array("Q"), False
        for place, opcode, begin, end in _heads(file):
            places.append(place)
            first.append(begin)
            last.append(end)
            chunked |= opcode == CHUNK
        file.seek(max(file.seek(0, os.SEEK_END) - FOOTER_SIZE, 0))
        closed = has_footer(file.read())
        file.seek(0)
        return cls(places, first, last) if chunked or closed else cls()

    def ready(self, messages: list[RawMessage], place: int) -> list[RawMessage]:
        """Take what was read up to ``place`` of the file; return what may be given out."""
        if not self._places:
            return messages
        self._held += messages
        following = bisect.bisect_left(self._places, place)
        if not 0 < following < len(self._places) or (
            self._least[following] < self._most[following - 1]
        ):
            return []
        return self.rest()

    def rest(self) -> list[RawMessage]:
        """Return what is held, when nothing that is older comes."""
        held, self._held = self._held, []
        times = list(map(_log_time, held))
        if times == sorted(times) or _begins_anew(held):
            return held
        return sorted(held, key=_log_time)


def _begins_anew(messages: Iterable[RawMessage]) -> bool:
    """Tell whether log time begins anew, as simulated time does when a plant is restarted.

    Then older times of a topic come one after the other, and fall between those that it had
    before. By log time such runs would be mixed, so that they keep the order of the file.
    """
    known: dict[str, list[int]] = {}
    older: dict[str, list[int]] = {}
    for topic, time, _, _ in messages:
        times, run = known.setdefault(topic.name, []), older.setdefault(topic.name, [])
        if not times or time >= times[-1]:
            times.append(time)
            run.clear()
            continue
        bisect.insort(times, time)
        if run and time <= run[-1]:
            run.clear()
        run.append(time)
        if len(run) == AGAIN:
            between = bisect.bisect_right(times, time) - bisect.bisect_left(times, run[0])
            if between > AGAIN:
                return True
            run.clear()
    return False


def _heads(file: BinaryIO) -> Iterator[tuple[int, int, int, int]]:
    """Yield place, opcode, first and last log time of chunks, and of messages outside of them."""
    size, place = file.seek(0, os.SEEK_END), len(MAGIC)
    longest = RECORD.size + max(CHUNK_TIMES.size, MESSAGE_HEAD.size)
    while place + RECORD.size + CHUNK_TIMES.size <= size:
        file.seek(place)
        head = file.read(longest)
        opcode, length = RECORD.unpack_from(head)
        if opcode in (0, DATA_END):
            return
        if opcode == CHUNK:
            yield place, opcode, *CHUNK_TIMES.unpack_from(head, RECORD.size)
        elif opcode == MESSAGE and len(head) == longest:
            _, _, time, _ = MESSAGE_HEAD.unpack_from(head, RECORD.size)
            yield place, opcode, time, time
        place += RECORD.size + length
