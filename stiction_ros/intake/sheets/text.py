"""The text of a file, whatever it is packed and encoded in."""

import codecs
import contextlib
import gzip
import io
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from stiction_ros.errors import InputError
from stiction_ros.records.storage.packed import opened

GZIP, ZIP, PARQUET = b"\x1f\x8b", b"PK\x03\x04", b"PAR1"

REFUSED = (
    (ZIP, "is a zip archive", "unpack it"),
    (
        (b"<htm", b"<HTM", b"<?xm", b"<!DO", b"<!do", b"<tab", b"<TAB"),
        "is a page or XML, no table of text",
        "open it in a spreadsheet program and save it as .xlsx or CSV",
    ),
    (
        b"\xd0\xcf\x11\xe0",
        "is an Excel workbook of the old kind, or one with a password",
        "save it as .xlsx without a password, or as CSV",
    ),
)
"""First bytes of files that are no text, what these are, and what helps."""

HEAD = 4096  # bytes by which the encoding is told


def _as_western(error: UnicodeError) -> tuple[str, int]:
    """Read bytes that are no UTF-8 as those of Western Europe."""
    if not isinstance(error, UnicodeDecodeError):
        raise error
    return error.object[error.start : error.end].decode("latin-1"), error.end


codecs.register_error("stiction_western", _as_western)


def magic(path: Path) -> bytes:
    """Return the first bytes of a file; none of that name is an :class:`InputError`."""
    try:
        with path.open("rb") as file:
            return file.read(4)
    except FileNotFoundError:
        raise InputError("no such file", fix="check the path") from None


@contextlib.contextmanager
def open_text(path: Path) -> Iterator[io.TextIOBase]:
    """Open a text file, gzip or Zstandard unpacked: UTF-8, UTF-16, or Western European bytes.

    Raises:
        InputError: no such file, no text, an archive, or packed data that is cut off, also
            while it is read.
    """
    first = magic(path)
    for start, what, fix in REFUSED:
        if first.startswith(start):
            raise InputError(what, fix=fix)
    try:
        unpacked: Any = gzip.open if first.startswith(GZIP) else opened
        with unpacked(path) as data:
            buffered = io.BufferedReader(data, 1 << 20)
            encoding = _encoding(buffered.peek(HEAD)[:HEAD])
            yield io.TextIOWrapper(
                buffered, encoding=encoding, errors="stiction_western", newline=""
            )
    except (EOFError, zlib.error, gzip.BadGzipFile):
        raise InputError("is cut off or damaged", fix="pack or copy it anew") from None


def _encoding(head: bytes) -> str:
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    if b"\0" not in head:
        return "utf-8-sig"
    raise InputError("is no text", fix="save it as CSV in UTF-8")
