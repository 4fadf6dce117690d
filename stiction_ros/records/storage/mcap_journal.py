"""The file that a bag writer appends to while it runs: unchunked, whole after every record."""

import os
from pathlib import Path
from typing import Protocol

from mcap.data_stream import RecordBuilder
from mcap.records import Header

from stiction_ros.records.storage.mcap_scan import MAGIC

_BLOCK = 1 << 20


class Writable(Protocol):
    """A record of the package ``mcap``."""

    def write(self, stream: RecordBuilder, /) -> None:
        """Append the record to ``stream``."""


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
