"""Turns the journal of a bag writer into a finished rosbag2 bag."""

from __future__ import annotations

import os
from pathlib import Path
from typing import IO

from mcap.writer import CompressionType, Writer

from stiction_ros.errors import InputError
from stiction_ros.records.bag_metadata import (
    BagFile,
    BagTopic,
    bag_information,
    metadata_record,
    metadata_yaml,
)
from stiction_ros.records.mcap_scan import McapScan

CLOCK = "/clock"
_COMPRESSIONS = {
    "zstd": CompressionType.ZSTD,
    "lz4": CompressionType.LZ4,
    "none": CompressionType.NONE,
}


def storage_path(directory: Path) -> Path:
    """Return the MCAP file of the bag ``directory``."""
    return directory / f"{directory.resolve().name}_0.mcap"


def finish_bag(
    directory: str | Path, *, compression: str = "zstd", chunk_size: int = 1 << 20
) -> tuple[str, ...]:
    """Rewrite the journal of a bag chunked and indexed and write its ``metadata.yaml``.

    Where there is a ``/clock``, what was received before its first message (configurations,
    latched topics) came at wall time, years away; it gets that first simulated time.

    The journal is replaced when the new file is complete on the disk, so that a second
    kill loses nothing either.

    Args:
        directory: a bag whose writer has ended, by itself or by a kill.
        compression: ``zstd``, ``lz4`` or ``none``.
        chunk_size: bytes of messages in one chunk.

    Returns:
        What was left out, one sentence each; empty when nothing was.

    Raises:
        InputError: no journal there, or a damaged one.
    """
    directory = Path(directory)
    if compression not in _COMPRESSIONS:
        raise InputError(
            f"compression {compression!r} is not known", fix=f"use {', '.join(_COMPRESSIONS)}"
        )
    path = storage_path(directory)
    scan = McapScan(path)
    partial = path.with_suffix(".mcap.part")
    try:
        with partial.open("wb") as output:
            writer = Writer(
                output,
                chunk_size=chunk_size,
                compression=_COMPRESSIONS[compression],
                use_summary_offsets=False,
                enable_crcs=True,
                enable_data_crcs=True,
            )
            information = _Rewrite(writer, path.name).run(scan, _first_clock(path))
            output.flush()
            os.fsync(output.fileno())
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    _write_whole(directory / "metadata.yaml", metadata_yaml(information))
    return tuple(scan.notes)


def _first_clock(path: Path) -> int | None:
    """Return the log time of the first message on ``/clock``, or None."""
    messages = McapScan(path).messages()
    return next((message.log_time for message in messages if message.topic.name == CLOCK), None)


class _Rewrite:
    """Copies a scan into a new file and sums up what is in it."""

    def __init__(self, writer: Writer, name: str) -> None:
        self._writer = writer
        self._name = name
        self._channels: dict[BagTopic, int] = {}
        self._schemas: dict[tuple[str, str, str], int] = {}

    def run(self, scan: McapScan, clock: int | None) -> dict[str, object]:
        """Copy everything, what came before the first ``clock`` at its time; sum it up."""
        writer = self._writer
        writer.start(profile="ros2", library="stiction_ros")
        counts: dict[BagTopic, int] = {}
        first: int | None = None
        last: int | None = None
        for topic, log_time, publish_time, data in scan.messages():
            if topic.name == CLOCK:
                clock = None
            elif clock is not None:
                log_time = clock
            channel = self._channels.get(topic) or self._register(topic)
            count = counts.get(topic, 0)
            writer.add_message(channel, log_time, data, publish_time, count & 0xFFFFFFFF)
            counts[topic] = count + 1
            first = log_time if first is None else min(first, log_time)
            last = log_time if last is None else max(last, log_time)
        for topic in scan.topics.values():
            if topic not in self._channels:
                self._register(topic)
        for name, mapping in scan.metadata:
            if name != "rosbag2":
                writer.add_metadata(name, mapping)
        file = BagFile(self._name, {t.name: n for t, n in counts.items()}, first, last)
        information = bag_information(file, list(scan.topics.values()))
        writer.add_metadata("rosbag2", metadata_record(information))
        writer.finish()  # type: ignore[no-untyped-call]
        return information

    def _register(self, topic: BagTopic) -> int:
        key = (topic.type, topic.schema_encoding, topic.definition)
        if key not in self._schemas:
            self._schemas[key] = self._writer.register_schema(
                topic.type, topic.schema_encoding, topic.definition.encode()
            )
        channel = self._writer.register_channel(
            topic.name, topic.encoding, self._schemas[key], topic.channel_metadata()
        )
        self._channels[topic] = channel
        return channel


def _write_whole(path: Path, text: str) -> None:
    """Write a file so that a reader sees the old one or the new one."""
    partial = path.with_suffix(path.suffix + ".part")
    stream: IO[str]
    with partial.open("w", encoding="utf-8") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(partial, path)
