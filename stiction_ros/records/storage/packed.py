"""Storage files that are packed whole, or of another storage."""

import contextlib
import shlex
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import zstandard

from stiction_ros.errors import InputError

SUFFIXES = (".zstd", ".zst")  # of files packed with Zstandard; rosbag2 writes the first

SQLITE = b"SQLite format 3\0"
ZSTD = b"\x28\xb5\x2f\xfd"  # first bytes of a file of either kind


def conversion(bag: Path) -> str:
    """Return how a bag that is not read is made one that is."""
    source, target = shlex.quote(str(bag)), shlex.quote(f"{bag.absolute().stem}_mcap")
    return (
        f"convert it: `pip install rosbags`, then `rosbags-convert --src {source} "
        f"--dst {target} --dst-storage mcap`, and give {target}"
    )


@contextlib.contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """Open a storage file; one packed with Zstandard is unpacked into a temporary file."""
    with path.open("rb") as file:
        packed = file.read(len(ZSTD)) == ZSTD
        file.seek(0)
        if not packed:
            yield file
            return
        with tempfile.TemporaryFile() as plain:
            try:
                plain.writelines(unpacked(file))
            except (zstandard.ZstdError, EOFError):
                raise InputError(
                    "is packed with Zstandard and cut off or damaged",
                    where=str(path),
                    fix="pack or copy it anew",
                ) from None
            plain.seek(0)
            yield plain


def unpacked(source: BinaryIO) -> Iterator[bytes]:
    """Yield what frames of Zstandard hold, a block at a time; EOFError if the last is cut off."""
    frame = zstandard.ZstdDecompressor().decompressobj()
    while block := source.read(zstandard.DECOMPRESSION_RECOMMENDED_INPUT_SIZE):
        while block:
            if frame.eof:
                frame = zstandard.ZstdDecompressor().decompressobj()
            yield frame.decompress(block)
            block = frame.unused_data
    if not frame.eof:
        raise EOFError
