"""The text of a file, whatever it is packed and encoded in."""

from __future__ import annotations

import codecs
import contextlib
import gzip
import io
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, cast

import zstandard

from stiction_ros.errors import InputError
from stiction_ros.records.storage.packed import ZSTD, unpacked

GZIP, ZIP, OLD_EXCEL = b"\x1f\x8b", b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
PARQUET, MARKUP = b"PAR1", (b"<htm", b"<HTM", b"<?xm", b"<!DO", b"<!do", b"<tab", b"<TAB")

HEAD = 4096
"""Bytes by which the encoding is told."""

SHORTEST = 16
"""Bytes from which UTF-16 without its mark is told."""

NULLS = 0.7
"""Share of zero bytes on one side of the pairs from which text is UTF-16 without its mark."""


def _as_western(error: UnicodeError) -> tuple[str, int]:
    """Read bytes that are no UTF-8 as those of Western Europe."""
    if not isinstance(error, UnicodeDecodeError):
        raise error
    return error.object[error.start : error.end].decode("latin-1"), error.end


codecs.register_error("stiction_western", _as_western)


def magic(path: Path) -> bytes:
    """Return the first bytes of a file.

    Raises:
        InputError: no such file, or it cannot be read.
    """
    where = str(path)
    try:
        with path.open("rb") as file:
            return file.read(4)
    except FileNotFoundError:
        raise InputError("no such file", where=where, fix="check the path") from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=where) from None


@contextlib.contextmanager
def open_text(path: Path) -> Iterator[io.TextIOBase]:
    """Open a text file, gzip or Zstandard unpacked: UTF-8, UTF-16, or Western European bytes.

    Args:
        path: the file; what it is packed in is told by its first bytes.

    Raises:
        InputError: no such file, no text, an archive, or packed data that is cut off, also
            while it is read.
    """
    where = str(path)
    first = magic(path)
    if first.startswith(ZIP):
        raise InputError("is a zip archive", where=where, fix="unpack it")
    if first.startswith(MARKUP):
        raise InputError(
            "is a page or XML, no table of text",
            where=where,
            fix="open it in a spreadsheet program and save it as .xlsx or CSV",
        )
    if first.startswith(OLD_EXCEL):
        raise InputError(
            "is an Excel workbook of the old kind, or one with a password",
            where=where,
            fix="save it as .xlsx without a password, or as CSV",
        )
    try:
        with contextlib.ExitStack() as stack:
            data = stack.enter_context(_unpacked(path, first))
            buffered = io.BufferedReader(cast(io.RawIOBase, data), 1 << 20)
            encoding = _encoding(buffered.peek(HEAD)[:HEAD], where)
            text = io.TextIOWrapper(
                buffered, encoding=encoding, errors="stiction_western", newline=""
            )
            yield text
    except OSError as error:
        if isinstance(error, gzip.BadGzipFile):
            raise _damaged(where) from None
        raise InputError(f"cannot be read ({error.strerror or error})", where=where) from None
    except (EOFError, zlib.error, zstandard.ZstdError):
        raise _damaged(where) from None


def _unpacked(path: Path, first: bytes) -> BinaryIO:
    if first.startswith(GZIP):
        return cast(BinaryIO, gzip.open(path, "rb"))
    if first.startswith(ZSTD):
        return cast(BinaryIO, _Zstd(path))
    return path.open("rb")


class _Zstd(io.RawIOBase):
    """Bytes of a file packed with Zstandard; one that is cut off is an EOFError."""

    def __init__(self, path: Path) -> None:
        self.file = path.open("rb")
        self.blocks, self.ready = unpacked(self.file), b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        while not self.ready and (block := next(self.blocks, None)) is not None:
            self.ready = block
        view = memoryview(buffer)
        count = min(len(view), len(self.ready))
        view[:count] = self.ready[:count]
        self.ready = self.ready[count:]
        return count

    def close(self) -> None:
        self.file.close()
        super().close()


def _encoding(head: bytes, where: str) -> str:
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    if b"\0" in head and len(head) < SHORTEST:
        raise InputError("is no text", where=where, fix="save it as CSV in UTF-8")
    if b"\0" in head:
        pairs = max(len(head) // 2, 1)
        even, odd = head[0::2].count(0) / pairs, head[1::2].count(0) / pairs
        if odd > NULLS and even < 0.1 * odd:
            return "utf-16-le"
        if even > NULLS and odd < 0.1 * even:
            return "utf-16-be"
        raise InputError("is no text", where=where, fix="save it as CSV in UTF-8")
    return "utf-8-sig"


def _damaged(where: str) -> InputError:
    return InputError("is cut off or damaged", where=where, fix="pack or copy it anew")
