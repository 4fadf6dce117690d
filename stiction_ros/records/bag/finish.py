"""Turns the journals of a bag writer into a finished rosbag2 bag."""

import dataclasses
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from mcap.writer import CompressionType, Writer

from stiction_ros.errors import InputError
from stiction_ros.records.bag.run_metadata import RUN, custom_data, merged
from stiction_ros.records.storage import bag_metadata as metadata
from stiction_ros.records.storage.files import METADATA, found_files
from stiction_ros.records.storage.log_time import SIMULATED
from stiction_ros.records.storage.mcap_scan import McapScan

CLOCK = "/clock"
ROSBAG2 = "rosbag2"
COMPRESSIONS = {
    "zstd": CompressionType.ZSTD,
    "lz4": CompressionType.LZ4,
    "none": CompressionType.NONE,
}


@dataclasses.dataclass(frozen=True)
class Packing:
    """How a finished file is packed: ``zstd``, ``lz4`` or ``none``, and bytes in a chunk."""

    compression: str = "zstd"
    chunk_size: int = 1 << 18

    def __post_init__(self) -> None:
        if self.compression not in COMPRESSIONS:
            raise InputError(
                f"compression {self.compression!r} is not known",
                fix=f"use {', '.join(COMPRESSIONS)}",
            )


class FileContent(NamedTuple):
    """One storage file: its name, counts and times, and the scan of all of it."""

    file: metadata.BagFile
    scan: McapScan


def storage_path(directory: Path, number: int = 0) -> Path:
    """Return an MCAP file of the bag ``directory``; splits are numbered from 0."""
    return directory / f"{directory.resolve().name}_{number}.mcap"


def finish_bag(directory: str | Path, packing: Packing = Packing()) -> tuple[str, ...]:
    """Rewrite the journals of a bag chunked and indexed and write its ``metadata.yaml``.

    What was received before simulated time was known (configurations, latched topics) came at wall
    time, years away; it gets the first simulated time. A journal is replaced when the new file is
    complete on the disk, so that a second kill loses nothing either.

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
    return tuple(note for content in contents for note in content.scan.notes)


def log_time_caps(files: Sequence[Path]) -> list[int | None]:
    """Return for each file the log time, ns, that what came before simulated time gets.

    It is the first simulated time up to the file in which that is; else None.
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
    path: Path, packing: Packing = Packing(), *, cap: int | None = None, salvage: bool = False
) -> FileContent:
    """Rewrite one file chunked and indexed, in its place.

    Messages get ``cap``, the first simulated time of the bag, ns, as log time until it comes. To
    ``salvage`` is to leave out what is damaged, with a note, instead of raising.
    """
    scan = McapScan(path, salvage=salvage)
    partial = path.with_suffix(".mcap.part")
    try:
        with partial.open("wb") as output:
            target = Writer(
                output,
                chunk_size=packing.chunk_size,
                compression=COMPRESSIONS[packing.compression],
                use_summary_offsets=False,  # it writes them for groups that are empty, too
                enable_data_crcs=True,
            )
            target.start("ros2", "stiction_ros")
            content = FileContent(_copy(scan, target, cap), scan)
            if run := merged(scan.metadata):
                target.add_metadata(RUN, run)
            for name, mapping in scan.metadata:
                if name not in (RUN, ROSBAG2):
                    target.add_metadata(name, mapping)
            target.add_metadata(ROSBAG2, metadata.metadata_record(_information([content])))
            target.finish()  # type: ignore[no-untyped-call]
            output.flush()
            os.fsync(output.fileno())
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    return content


def write_listing(directory: Path, contents: Sequence[FileContent]) -> None:
    """Write ``metadata.yaml`` for the files of a bag, one at least, in their order."""
    text = metadata.yaml_text({"rosbag2_bagfile_information": _information(contents)})
    partial = directory / f"{METADATA}.part"
    with partial.open("w", encoding="utf-8") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(partial, directory / METADATA)  # a reader sees the old one or the new one


def _copy(scan: McapScan, target: Writer, cap: int | None) -> metadata.BagFile:
    """Copy all messages and topics; return what was written."""
    schemas: dict[tuple[str, str, str], int] = {}
    channels: dict[metadata.BagTopic, int] = {}
    counts: Counter[str] = Counter()
    first: int | None = None
    last: int | None = None

    def announce() -> None:
        for topic in scan.topics.values():
            if topic in channels:
                continue
            key = (topic.type, topic.schema_encoding, topic.definition)
            if key not in schemas:
                schemas[key] = target.register_schema(*key[:2], topic.definition.encode())
            channels[topic] = target.register_channel(
                topic.name, topic.encoding, schemas[key], topic.channel_metadata()
            )
            counts[topic.name] += 0

    for topic, log_time, publish_time, data in scan.messages():
        if len(channels) < len(scan.topics):
            announce()
        if cap is not None:
            if log_time <= cap:
                cap = None
            else:
                log_time = cap
        sequence = counts[topic.name] & 0xFFFFFFFF
        target.add_message(channels[topic], log_time, data, publish_time, sequence)
        counts[topic.name] += 1
        first = log_time if first is None else min(first, log_time)
        last = log_time if last is None else max(last, log_time)
    announce()
    return metadata.BagFile(scan.path.name, counts, first, last)


def _information(contents: Sequence[FileContent]) -> dict[str, object]:
    topics: dict[str, metadata.BagTopic] = {}
    run: dict[str, str] = {}
    for _, scan in contents:
        run.update(merged(scan.metadata))
        for topic in scan.topics.values():
            topics.setdefault(topic.name, topic)
    files = [content.file for content in contents]
    return metadata.bag_information(files, list(topics.values()), custom=custom_data(run))
