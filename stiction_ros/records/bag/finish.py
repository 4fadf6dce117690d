"""Turns the journals of a bag writer into a finished rosbag2 bag."""

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from mcap.writer import CompressionType, Writer

from stiction_ros.records.bag.run_metadata import RUN, custom_data, merged
from stiction_ros.records.storage.bag_metadata import VERSION, BagTopic, yaml_text
from stiction_ros.records.storage.files import METADATA, found_files
from stiction_ros.records.storage.mcap_scan import McapScan

ROSBAG2 = "rosbag2"


def storage_path(directory: Path, number: int = 0) -> Path:
    """Return an MCAP file of the bag ``directory``; splits are numbered from 0."""
    return directory / f"{directory.resolve().name}_{number}.mcap"


def finish_bag(directory: str | Path, compression: str = "zstd", chunk_size: int = 1 << 18) -> None:
    """Rewrite the journals of a bag chunked and indexed and write its ``metadata.yaml``.

    What was received before simulated time was known (configurations, latched topics) came at wall
    time, years away; it gets the first simulated time. A journal is replaced when the new file is
    complete on the disk, so that a second kill loses nothing either. Chunks of ``chunk_size`` bytes
    are packed by ``zstd``, ``lz4`` or ``none``.

    Raises:
        InputError: no journal there, or a damaged one.
        OSError: the storage refuses; the journals are then as they were.
    """
    directory = Path(directory)
    files = found_files(directory)
    pairs = zip(files, log_time_caps(files), strict=True)
    whole = [rewrite(McapScan(file, cap=cap), compression, chunk_size) for file, cap in pairs]
    write_listing(directory, whole)


def log_time_caps(files: Sequence[Path]) -> list[int | None]:
    """Return for each file the log time, ns, that what came before simulated time gets.

    It is the first simulated time, as the recorder tells it, up to the file in which it does so;
    else None.
    """
    for number, file in enumerate(files):
        scan = McapScan(file, salvage=True)
        for _ in scan.messages():
            if scan.simulated is not None:
                break
        if scan.simulated is not None:
            return [scan.simulated if place <= number else None for place in range(len(files))]
    return [None] * len(files)


def rewrite(scan: McapScan, compression: str = "zstd", chunk_size: int = 1 << 18) -> McapScan:
    """Rewrite a file chunked and indexed, in its place; return the scan, which is then complete."""
    partial = scan.path.with_suffix(".mcap.part")
    try:
        with partial.open("wb") as output:
            target = Writer(
                output,
                chunk_size=chunk_size,
                compression=CompressionType[compression.upper()],
                use_summary_offsets=False,  # it writes them for groups that are empty, too
                enable_data_crcs=True,
            )
            target.start("ros2", "stiction_ros")
            _copy(scan, target)
            if run := merged(scan.metadata):
                target.add_metadata(RUN, run)
            for name, mapping in scan.metadata:
                if name not in (RUN, ROSBAG2):
                    target.add_metadata(name, mapping)
            target.add_metadata(ROSBAG2, metadata_record(scan))
            target.finish()  # type: ignore[no-untyped-call]
            output.flush()
            os.fsync(output.fileno())
        os.replace(partial, scan.path)
    finally:
        partial.unlink(missing_ok=True)
    return scan


def write_listing(directory: Path, scans: Sequence[McapScan]) -> None:
    """Write ``metadata.yaml`` for the files of a bag, one at least, in their order."""
    partial = directory / f"{METADATA}.part"
    with partial.open("w", encoding="utf-8") as stream:
        stream.write(yaml_text({"rosbag2_bagfile_information": _information(*scans)}))
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(partial, directory / METADATA)  # a reader sees the old one or the new one


def metadata_record(scan: McapScan) -> dict[str, str]:
    """Return the content of the MCAP metadata record ``rosbag2`` of one file."""
    return {"serialized_metadata": yaml_text(_information(scan))}


def _copy(scan: McapScan, target: Writer) -> None:
    schemas: dict[tuple[str, str, str], int] = {}
    channels: dict[BagTopic, int] = {}
    sequence: Counter[str] = Counter()

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

    for topic, log_time, publish_time, data in scan.messages():
        if len(channels) < len(scan.topics):
            announce()
        number = sequence[topic.name] & 0xFFFFFFFF
        target.add_message(channels[topic], log_time, data, publish_time, number)
        sequence[topic.name] += 1
    announce()


def _information(*scans: McapScan) -> dict[str, Any]:
    """Return the mapping ``rosbag2_bagfile_information`` of files in their order."""
    topics: dict[str, BagTopic] = {}
    for scan in scans:
        topics |= {topic.name: topics.get(topic.name, topic) for topic in scan.topics.values()}
    counts = sum((scan.counts for scan in scans), Counter[str]())
    run = custom_data(merged(entry for scan in scans for entry in scan.metadata))
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        **_span(*scans),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type,
                    "serialization_format": topic.encoding,
                    "offered_qos_profiles": yaml.safe_load(topic.qos_yaml) or [],
                    "type_description_hash": topic.type_hash,
                },
                "message_count": counts[topic.name],
            }
            for topic in topics.values()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [scan.path.name for scan in scans],
        "files": [{"path": scan.path.name, **_span(scan)} for scan in scans],
        "custom_data": run or None,
        "ros_distro": "jazzy",
    }


def _span(*scans: McapScan) -> dict[str, Any]:
    """Return starting time, duration and count of files as ``metadata.yaml`` has them."""
    first = min(scan.first for scan in scans)
    last = max(first, *(scan.last for scan in scans))
    return {
        "duration": {"nanoseconds": last - first},
        "starting_time": {"nanoseconds_since_epoch": first},
        "message_count": sum(scan.counts.total() for scan in scans),
    }
