"""Writes a rosbag2 directory that survives the death of its writer.

While it runs, ``<dir>_0.mcap`` is a journal; :func:`finish_bag` makes a finished bag of it.
"""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Header, McapRecord, Message, Metadata, Schema

from stiction_ros import __version__
from stiction_ros.checks import one_of
from stiction_ros.errors import InputError, storing
from stiction_ros.records.bag.finish import ROSBAG2, finish_bag, metadata_record, storage_path
from stiction_ros.records.bag.run_metadata import RUN, news
from stiction_ros.records.storage.bag_metadata import BagTopic, Qos, qos_yaml
from stiction_ros.records.storage.mcap_scan import MAGIC, McapScan

__all__ = ["BagWriter", "Qos"]
_BLOCK = 1 << 20


class Journal:
    """One MCAP file without chunks and without an end, at a ``path`` that is not there yet.

    What was written stands in the file, of ``size`` bytes, when a method returns, so that a kill of
    this process loses none of it. A record that the storage refuses leaves nothing behind: the
    file is cut back to its last whole record.

    Raises:
        OSError: from every method, the storage refuses.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = 0
        self._file = path.open("x+b", buffering=0)
        try:
            self.append(MAGIC)
            self.put(Header(profile="ros2", library="stiction_ros"))
        except OSError:
            self.discard()
            raise

    @property
    def is_there(self) -> bool:
        """Whether the file still stands under its name."""
        try:
            return os.path.samestat(os.stat(self.path), os.fstat(self._file.fileno()))
        except OSError:
            return False

    def put_back(self) -> None:
        """Write the file again after somebody has removed it; until closed it is still there."""
        other = self.path.open("x+b", buffering=0)
        try:
            for begin in range(0, self.size, _BLOCK):
                block = os.pread(self._file.fileno(), min(_BLOCK, self.size - begin), begin)
                while block:
                    block = block[other.write(block) :]
        except OSError:
            other.close()
            self.path.unlink(missing_ok=True)
            raise
        self._file.close()
        self._file = other

    def discard(self) -> None:
        """Close and remove the file."""
        self._file.close()
        self.path.unlink(missing_ok=True)

    def put(self, entry: McapRecord) -> None:
        builder = RecordBuilder()
        entry.write(builder)
        self.append(builder.end())  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        self._file.close()

    def append(self, data: bytes) -> None:
        """Append whole records as they are."""
        try:
            written = self._file.write(data)
            while written < len(data):
                written += self._file.write(data[written:])
        except OSError:
            os.ftruncate(self._file.fileno(), self.size)
            self._file.seek(self.size)
            raise
        self.size += written


class BagWriter:
    """A rosbag2 bag (MCAP storage) being written; also a context manager.

    Every message is one unchunked record, handed to the operating system before :meth:`write`
    returns. One thread writes. Times are integers in ns. What ``~/config`` and
    ``loop_model`` say is kept as metadata of the run too. The directory is made with parents and
    must not hold anything yet. The bag goes on in its next file where one holds ``most_bytes`` of
    messages, before compression, or ``most_ns`` of log time; 0 for never.

    Attributes:
        counts: messages written so far, by topic.
    """

    def __init__(
        self,
        directory: str | Path,
        compression: str = "zstd",
        most_bytes: int = 0,
        most_ns: int = 0,
        chunk_size: int = 1 << 18,
    ) -> None:
        self.directory = Path(directory)
        one_of(compression, ("zstd", "lz4", "none"), "compression")
        self._packing = compression, chunk_size
        self._most = most_bytes, most_ns
        self._topics: dict[str, BagTopic] = {}
        self._channels: dict[str, int] = {}
        self.counts: dict[str, int] = {}
        self._schemas: dict[tuple[str, str], int] = {}
        self._run = {"recorder": f"stiction_ros {__version__}"}
        self._number = 0
        self._first: int | None = None
        self._closed = False
        _make_empty(self.directory)
        self._journal: Journal
        self._begin_file(0)

    def add_topic(
        self,
        name: str,
        type: str,
        definition_text: str,
        type_hash: str,
        qos: Qos | Iterable[Qos] = Qos(),  # noqa: B008 (frozen)
    ) -> None:
        """Announce a topic, by full name and type such as ``sensor_msgs/msg/JointState``.

        Its definition has its dependencies with it, and a hash or none, as :func:`definition`
        gives them; ``qos`` is one profile of its publishers or one for each.
        """
        self._open()
        profiles = (qos,) if isinstance(qos, Qos) else tuple(qos)
        topic = BagTopic(name, type, definition_text, type_hash, qos_yaml(profiles))
        known = self._topics.get(name, topic)
        if known.type != type:
            raise InputError(
                f"topic {name} is recorded as {known.type} and cannot also be {type}",
                where=str(self.directory),
            )
        if name not in self._topics:
            self._announce(topic, len(self._topics) + 1)
            self._topics[name], self.counts[name] = topic, 0

    def write(self, topic: str, data: bytes, log_time: int, publish_time: int) -> None:
        """Write one serialised message (CDR) of a topic; it is safe from a kill when this returns.

        Log time, when it was received, is simulated when there is a clock; ``publish_time`` is when
        it was sent, ns. Where the storage refuses, as a full disk does, it is an OSError.
        """
        if topic not in self._topics:
            raise InputError(f"topic {topic} was not added", where=str(self.directory))
        if self._is_full(log_time):
            self._go_on()
        sequence = self.counts[topic] & 0xFFFFFFFF
        channel = self._channels[topic]
        self._journal.put(Message(channel, log_time, data, publish_time, sequence))
        self.counts[topic] += 1
        self._learn(news(topic, self._topics[topic].type, data))

    def add_metadata(self, name: str, mapping: Mapping[str, str]) -> None:
        """Add a metadata record; those of the run the writer keeps by itself."""
        self._open()
        self._journal.put(Metadata(metadata=dict(mapping), name=name))

    def put_back(self) -> str:
        """Write again what somebody has removed meanwhile; return a sentence, empty for none.

        Of the present file nothing is lost; files that were complete cannot be written again.
        """
        if self._journal.is_there:
            return ""
        self.directory.mkdir(parents=True, exist_ok=True)
        self._journal.put_back()
        before = (storage_path(self.directory, number) for number in range(self._number))
        gone = sum(not path.exists() for path in before)
        said = f"{self._journal.path} was removed and is written again"
        return f"{said}; {gone} files before it are lost" if gone else said

    def close(self) -> None:
        """Finish the bag; a second call does nothing. If the storage refuses the journals stay."""
        if self._closed:
            return
        self.put_back()
        self._closed = True
        self._journal.close()
        finish_bag(self.directory, *self._packing)

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _open(self) -> None:
        if self._closed:
            raise InputError("the bag is closed", where=str(self.directory))

    def _is_full(self, log_time: int) -> bool:
        """Tell whether a message of ``log_time`` belongs into the next file."""
        size, duration = self._most
        if self._first is None or log_time < self._first:  # simulated time follows wall time
            self._first = log_time
        elif duration and log_time - self._first >= duration:
            return True
        return bool(size) and self._journal.size >= size

    def _go_on(self) -> None:
        """Begin the next file; where the storage refuses the present one stays in use."""
        before = self._journal, self._schemas, self._first
        try:
            self._begin_file(self._number + 1)
        except OSError:
            if self._journal is not before[0]:
                self._journal.discard()
            self._journal, self._schemas, self._first = before
            raise
        before[0].close()

    def _begin_file(self, number: int) -> None:
        """Open the journal of a file and tell it what is known."""
        path = storage_path(self.directory, number)
        self._journal = Journal(path)
        self._first = None
        self._schemas = {}
        self._journal.put(Metadata(metadata=metadata_record(McapScan(path)), name=ROSBAG2))
        self._journal.put(Metadata(metadata=self._run, name=RUN))
        for channel, topic in enumerate(self._topics.values(), start=1):
            self._announce(topic, channel)
        self._number = number

    def _announce(self, topic: BagTopic, channel: int) -> None:
        """Write the channel of a topic, and its schema when the file has not got it yet."""
        key = (topic.type, topic.definition)
        if key not in self._schemas:
            number = len(self._schemas) + 1
            self._journal.put(Schema(number, topic.definition.encode(), "ros2msg", topic.type))
            self._schemas[key] = number
        metadata = topic.channel_metadata()
        self._journal.put(Channel(channel, topic.name, "cdr", metadata, self._schemas[key]))
        self._channels[topic.name] = channel

    def _learn(self, told: Mapping[str, str]) -> None:
        changed = {key: text for key, text in told.items() if self._run.get(key) != text}
        if changed:
            self._run.update(changed)
            self._journal.put(Metadata(metadata=changed, name=RUN))


def _make_empty(directory: Path) -> None:
    where = str(directory)
    fix = "choose another place or move it away"
    if directory.is_file():
        raise InputError("is a file, a bag is a directory", where=where, fix=fix)
    with storing(where, what="made"):
        directory.mkdir(parents=True, exist_ok=True)
        full = next(directory.iterdir(), None) is not None
    if full:
        raise InputError("exists and is not empty", where=where, fix=fix)
