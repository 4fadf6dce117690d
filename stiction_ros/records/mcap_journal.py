"""The file that a bag writer appends to while it runs: unchunked, whole after every record."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Protocol

from mcap.data_stream import RecordBuilder
from mcap.records import Header

from stiction_ros.records.mcap_format import MAGIC


class Writable(Protocol):
    """A record of the package ``mcap``."""

    def write(self, stream: RecordBuilder, /) -> None:
        """Append the record to ``stream``."""


class Journal:
    """One MCAP file without chunks and without an end.

    Args:
        path: a file that is not there yet.

    Attributes:
        path: the file.
        size: its bytes.

    What was written stands in the file when a method returns, so that a kill of this
    process loses none of it. A record that the storage refuses leaves nothing behind: the
    file is cut back to its last whole record.

    Raises:
        OSError: from every method, the storage refuses.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = 0
        self._file = path.open("xb", buffering=0)
        self.append(MAGIC)
        self.put(Header(profile="ros2", library="stiction_ros"))

    def put(self, entry: Writable) -> None:
        """Append a record."""
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
