"""Reads the records of one MCAP file from its beginning, whole, unfinished or damaged.

Unlike the readers of ``mcap`` it gives back complete messages only and compares every checksum.
"""

import os
import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import zstandard
from mcap import records as mcap_records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader, breakup_chunk

from stiction_ros.errors import InputError, storing
from stiction_ros.records.storage.bag_metadata import INFINITE_NS, BagTopic
from stiction_ros.records.storage.log_time import SIMULATED
from stiction_ros.records.storage.packed import SQLITE, conversion, opened

MAGIC = b"\x89MCAP0\r\n"
RECORD = struct.Struct("<BQ")  # opcode and length of the content, before every record

FOOTER_HEAD = RECORD.pack(Opcode.FOOTER, 20)
FOOTER_SIZE = len(FOOTER_HEAD) + 20 + len(MAGIC)  # bytes of the footer with the magic behind it

_DAMAGE: tuple[type[Exception], ...] = (
    *(ValueError, ArithmeticError, RuntimeError, EOFError, MemoryError, struct.error),
    *(McapError, zstandard.ZstdError),
)
"""What damaged bytes raise in the readers of records and in the decompressors."""


_KINDS: dict[int, Any] = {
    Opcode.SCHEMA: mcap_records.Schema,
    Opcode.CHANNEL: mcap_records.Channel,
    Opcode.METADATA: mcap_records.Metadata,
}
"""Other records that are read, by their opcode."""


class RawMessage(NamedTuple):
    """One message as bytes: its topic, log and publish time in ns, serialised data."""

    topic: BagTopic
    log_time: int
    publish_time: int
    data: bytes


class McapScan:
    """One pass over an MCAP file; to ``salvage`` is to pass over damaged records with a note.

    Messages get ``cap``, the first simulated time of the bag, ns, as log time until it comes.

    Attributes:
        topics: channel id to topic, filled as :meth:`messages` goes on.
        counts: messages by topic name, as far as :meth:`messages` has come.
        first: least log time met so far, ns; the infinite one while there is no message.
        last: largest log time met so far, ns.
        simulated: first simulated time that a recorder tells, ns; None so far.
        metadata: name and content of every metadata record met so far.
        chunked: whether a chunk was met.
        finished: whether it ends as a finished file does; False for a file whose writer
            was killed, or whose summary is damaged.
        notes: what was left out, one sentence each.
        damaged: whether there is a note on damage of the data, which only a salvage survives.
    """

    def __init__(self, path: Path, *, salvage: bool = False, cap: int | None = None) -> None:
        self.path = path
        self.topics: dict[int, BagTopic] = {}
        self.counts: Counter[str] = Counter()
        self.first, self.last = INFINITE_NS, 0
        self.simulated: int | None = None
        self.metadata: list[tuple[str, dict[str, str]]] = []
        self.chunked = self.finished = self.damaged = False
        self.notes: list[str] = []
        self._salvage, self._cap = salvage, cap
        self._schemas: dict[int, mcap_records.Schema] = {}

    def read(self) -> "McapScan":
        """Go through the whole file and return the scan."""
        for _ in self.messages():
            pass
        return self

    def messages(self) -> Iterator[RawMessage]:
        """Yield every complete message in the order of the file, those before a damage first.

        Raises:
            InputError: no such file, not an MCAP file, or damaged inside.
        """
        with storing(self.path, what="read"), opened(self.path) as file:
            self._refuse_foreign(file.read(len(MAGIC)))
            if self._salvage:  # the chunk that announces the topics may be damaged
                self._learn(_intact_summary(file))
            file.seek(len(MAGIC))
            yield from self._data(file)

    def _refuse_foreign(self, first: bytes) -> None:
        if first and SQLITE.startswith(first):
            what = "is a bag of storage sqlite3"
            raise InputError(what, where=str(self.path), fix=conversion(self.path))
        if first != MAGIC:
            fix = "give a rosbag2 directory or a .mcap file"
            raise InputError("is not an MCAP file", where=str(self.path), fix=fix)

    def _data(self, file: BinaryIO) -> Iterator[RawMessage]:
        size, place, checksum = os.fstat(file.fileno()).st_size, len(MAGIC), zlib.crc32(MAGIC)
        while True:
            head = file.read(RECORD.size)
            opcode, length = RECORD.unpack(head) if len(head) == RECORD.size else (0, 0)
            end = place + len(head) + length
            body = file.read(length) if end <= size else b""
            if not opcode or len(body) < length:  # opcode 0: blocks that a file system left empty
                self._torn(file, place)
                return
            if opcode == Opcode.DATA_END:
                self._end_of_data(body, checksum, file.read(), end)
                return
            checksum = zlib.crc32(body, zlib.crc32(head, checksum))
            found: list[RawMessage] = []
            try:
                self._take(self._records(opcode, body), found)
            except _DAMAGE as error:
                yield from found
                self._broken(place, str(error) or type(error).__name__)
            else:
                yield from found
            place = end

    def _records(self, opcode: int, body: bytes) -> Iterable[mcap_records.McapRecord]:
        """Return the records of a chunk, or the one record that there is."""
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.MESSAGE:
            return [mcap_records.Message.read(stream, len(body))]
        if opcode == Opcode.CHUNK:
            self.chunked = True
            return breakup_chunk(mcap_records.Chunk.read(stream), validate_crc=True)
        kind = _KINDS.get(opcode)
        return [kind.read(stream)] if kind is not None else []

    def _take(self, records: Iterable[mcap_records.McapRecord], found: list[RawMessage]) -> None:
        for record in records:
            if isinstance(record, mcap_records.Message):
                topic = self.topics.get(record.channel_id)
                if topic is None:
                    raise ValueError(f"a message of channel {record.channel_id} that is not known")
                self.counts[topic.name] += 1
                time = record.log_time if self._cap is None else min(self._cap, record.log_time)
                if time == record.log_time:
                    self._cap = None
                self.first, self.last = min(self.first, time), max(self.last, time)
                found.append(RawMessage(topic, time, record.publish_time, record.data))
            elif isinstance(record, mcap_records.Metadata):
                self.metadata.append((record.name, record.metadata))
                if record.name == SIMULATED and record.metadata.get("first", "").isdecimal():
                    self.simulated = int(record.metadata["first"])
            else:
                self._learn([record])

    def _learn(self, records: Iterable[mcap_records.McapRecord]) -> None:
        """Take topics; a summary repeats them, with those that have no message."""
        for record in records:
            if isinstance(record, mcap_records.Schema):
                self._schemas[record.id] = record
            elif isinstance(record, mcap_records.Channel):
                schema = self._schemas.get(record.schema_id, mcap_records.Schema(0, b"", "", ""))
                self.counts[record.topic] += 0
                self.topics[record.id] = BagTopic(
                    name=record.topic,
                    type=schema.name,
                    definition=schema.data.decode(),
                    type_hash=record.metadata.get("topic_type_hash", ""),
                    qos_yaml=record.metadata.get("offered_qos_profiles", ""),
                    encoding=record.message_encoding,
                    schema_encoding=schema.encoding,
                )

    def _end_of_data(self, body: bytes, checksum: int, rest: bytes, place: int) -> None:
        """Compare checksum and summary, which begins at ``place``, with what was read."""
        self.finished = True
        if self.damaged:  # of what was left out nothing more can be said
            return
        expected = mcap_records.DataEnd.read(
            ReadDataStream(BytesIO(body.ljust(4, b"\0")))
        ).data_section_crc
        if expected not in (0, checksum):
            self._broken(place, "the checksum of the data is wrong")
            return
        found, fault = self.counts.total(), ""
        try:
            summary = _summary(rest)
            self._learn(summary)
            told = [
                one.message_count for one in summary if isinstance(one, mcap_records.Statistics)
            ]
            if told and told[0] != found:
                fault = f"it says {told[0]} messages, there are {found}"
        except _DAMAGE as error:
            fault, expected = str(error) or type(error).__name__, 1
        if fault and not expected:
            self._broken(place, f"summary: {fault}")
        elif fault:
            self.finished = False
            self.notes.append(f"the summary of {self.path.name} is damaged ({fault}), not its data")

    def _torn(self, file: BinaryIO, place: int) -> None:
        """Note an unfinished file; raise when the file had been finished."""
        size = file.seek(0, os.SEEK_END)
        if _is_closed(_tail(file)):
            self._broken(place, "a record is longer than the file")
            return
        left = size - place
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


def _tail(file: BinaryIO) -> bytes:
    """Return the last :data:`FOOTER_SIZE` bytes of a file."""
    file.seek(max(file.seek(0, os.SEEK_END) - FOOTER_SIZE, 0))
    return file.read()


def _is_closed(tail: bytes) -> bool:
    """Tell whether a file with this tail was finished."""
    return tail.startswith(FOOTER_HEAD) and tail.endswith(MAGIC)


def _summary(rest: bytes) -> list[mcap_records.McapRecord]:
    """Return the records of a summary, its checksum compared."""
    if not _is_closed(rest[-FOOTER_SIZE:]):
        raise ValueError("no footer at its end")
    protected, (checksum,) = rest[: -len(MAGIC) - 4], struct.unpack_from("<I", rest, len(rest) - 12)
    if checksum and zlib.crc32(protected) != checksum:
        raise ValueError("the checksum of the summary is wrong")
    return list(StreamReader(BytesIO(rest), skip_magic=True).records)


def _intact_summary(file: BinaryIO) -> list[mcap_records.McapRecord]:
    """Return the records of a file's summary; none when it has none or it is damaged."""
    tail = _tail(file)
    if not _is_closed(tail):
        return []
    footer = mcap_records.Footer.read(ReadDataStream(BytesIO(tail[len(FOOTER_HEAD) :])))
    if not footer.summary_crc or not footer.summary_start:
        return []
    file.seek(min(footer.summary_start, file.tell()))
    try:
        return _summary(file.read())
    except _DAMAGE:
        return []
