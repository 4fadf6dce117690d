"""Turns the journals of a bag writer into a finished rosbag2 bag."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from stiction_ros.records.bag.run_metadata import RUN, custom_data, merged
from stiction_ros.records.storage.bag_metadata import (
    BagFile,
    BagTopic,
    bag_information,
    metadata_record,
    metadata_yaml,
)
from stiction_ros.records.storage.files import METADATA, found_files
from stiction_ros.records.storage.log_time import SIMULATED
from stiction_ros.records.storage.mcap_chunked import ChunkedFile
from stiction_ros.records.storage.mcap_scan import McapScan

CLOCK = "/clock"
ROSBAG2 = "rosbag2"


@dataclasses.dataclass(frozen=True)
class Packing:
    """How a finished file is packed.

    Attributes:
        compression: ``zstd``, ``lz4`` or ``none``.
        chunk_size: bytes of messages in one chunk before compression.
    """

    compression: str = "zstd"
    chunk_size: int = 1 << 18


@dataclasses.dataclass(frozen=True)
class FileContent:
    """What one storage file holds.

    Attributes:
        file: its name, counts and times.
        topics: in the order they were announced.
        run: what its metadata records say of the run.
        finished: whether its writer closed it.
        damaged: whether something in it is broken.
        notes: what was left out, one sentence each.
    """

    file: BagFile
    topics: tuple[BagTopic, ...]
    run: Mapping[str, str]
    finished: bool
    damaged: bool
    notes: tuple[str, ...]


def storage_path(directory: Path, number: int = 0) -> Path:
    """Return an MCAP file of the bag ``directory``; splits are numbered from 0."""
    return directory / f"{directory.resolve().name}_{number}.mcap"


def finish_bag(directory: str | Path, packing: Packing = Packing()) -> tuple[str, ...]:
    """Rewrite the journals of a bag chunked and indexed and write its ``metadata.yaml``.

    Where there is a simulated time, what was received before it was known (configurations,
    latched topics) came at wall time, years away; it gets the first simulated time.

    A journal is replaced when the new file is complete on the disk, so that a second kill
    loses nothing either.

    Args:
        directory: a bag whose writer has ended, by itself or by a kill.
        packing: of the finished files.

    Returns:
        What was left out, one sentence each; empty when nothing was.

    Raises:
        InputError: no journal there, or a damaged one.
        OSError: the storage refuses; the journals are then as they were.
    """
    directory = Path(directory)
    files = found_files(directory)
    caps = log_time_caps(files)
    contents = [rewrite(file, packing, cap=cap) for file, cap in zip(files, caps, strict=True)]
    write_listing(directory, contents)
    return tuple(note for content in contents for note in content.notes)


def log_time_caps(files: Sequence[Path]) -> list[int | None]:
    """Return for each file the log time, ns, that what came before simulated time gets.

    It is the first simulated time, for the files up to the one in which it is; None for those
    behind it, and for all when the bag knows no simulated time.
    """
    found: tuple[int, int] | None = None
    for number, file in enumerate(files):
        scan, looked = McapScan(file, salvage=True), 0
        for message in scan.messages():
            new, looked = scan.metadata[looked:], len(scan.metadata)
            for name, entry in new:
                if name == SIMULATED and entry.get("first", "").isdecimal():
                    return _caps(len(files), number, int(entry["first"]))
            if found is None and message.topic.name == CLOCK:
                found = number, message.log_time  # of a recorder that does not tell
    return _caps(len(files), *found) if found is not None else [None] * len(files)


def _caps(files: int, number: int, first: int) -> list[int | None]:
    return [first if place <= number else None for place in range(files)]


def rewrite(
    path: Path, packing: Packing, *, cap: int | None = None, salvage: bool = False
) -> FileContent:
    """Rewrite one file chunked and indexed, in its place.

    Args:
        path: the file, a journal for example.
        packing: of the new file.
        cap: first simulated time of the bag, ns; until it comes messages get it as log time.
        salvage: leave out what is damaged, with a note, instead of raising.

    Raises:
        InputError: damaged.
        OSError: the storage refuses.
    """
    scan = McapScan(path, salvage=salvage)
    partial = path.with_suffix(".mcap.part")
    try:
        with partial.open("wb") as output:
            target = ChunkedFile(
                output, compression=packing.compression, chunk_size=packing.chunk_size
            )
            channels = _copy(scan, target, cap)
            content = _content(path, scan, target, channels)
            if content.run:
                target.metadata(RUN, content.run)
            for name, mapping in scan.metadata:
                if name not in (RUN, ROSBAG2):
                    target.metadata(name, mapping)
            target.metadata(ROSBAG2, metadata_record(_information([content])))
            target.finish()
            output.flush()
            os.fsync(output.fileno())
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    return content


def write_listing(directory: Path, contents: Sequence[FileContent]) -> None:
    """Write ``metadata.yaml`` for the files of a bag, one at least, in their order."""
    text = metadata_yaml(_information(contents))
    partial = directory / f"{METADATA}.part"
    with partial.open("w", encoding="utf-8") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(partial, directory / METADATA)  # a reader sees the old one or the new one


def _copy(scan: McapScan, target: ChunkedFile, cap: int | None) -> dict[BagTopic, int]:
    """Copy all messages and topics; return the channels of the topics."""
    channels: dict[BagTopic, int] = {}
    for topic, log_time, publish_time, data in scan.messages():
        channel = channels.get(topic)
        if channel is None:
            channel = channels[topic] = target.topic(topic)
        if cap is not None:
            if log_time <= cap:
                cap = None
            else:
                log_time = cap
        target.message(channel, log_time, publish_time, data)
    for topic in scan.topics.values():
        if topic not in channels:
            channels[topic] = target.topic(topic)
    return channels


def _content(
    path: Path, scan: McapScan, target: ChunkedFile, channels: Mapping[BagTopic, int]
) -> FileContent:
    counts: dict[str, int] = {}
    for topic, channel in channels.items():
        counts[topic.name] = counts.get(topic.name, 0) + target.counts[channel]
    first, last = target.span()
    file = BagFile(path.name, counts, first, last)
    return content_of(file, scan)


def content_of(file: BagFile, scan: McapScan) -> FileContent:
    """Return what a file holds after a scan of all its messages."""
    topics = tuple(scan.topics.values())
    run = merged(scan.metadata)
    return FileContent(file, topics, run, scan.finished, scan.damaged, tuple(scan.notes))


def _information(contents: Sequence[FileContent]) -> dict[str, object]:
    topics: dict[str, BagTopic] = {}
    run: dict[str, str] = {}
    for content in contents:
        run.update(content.run)
        for topic in content.topics:
            topics.setdefault(topic.name, topic)
    files = [content.file for content in contents]
    return bag_information(files, list(topics.values()), custom=custom_data(run))
