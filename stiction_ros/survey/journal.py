"""Results as they come, a line each, from which a survey that was broken off goes on."""

import dataclasses
import hashlib
import json
from pathlib import Path
from typing import IO, Any

from stiction_ros.errors import InputError
from stiction_ros.intake.loop import Loop
from stiction_ros.survey.entry import Entry
from stiction_ros.texts import json_text

FILE = "loops.jsonl"


class Journal:
    """One file; its first line says what the options were, each other one holds a loop."""

    def __init__(self, folder: Path, mark: str, *, resume: bool) -> None:
        """Open the journal of a folder that is there, by the ``mark`` of the options.

        What is there counts to ``resume``; else no loop may be there. Another mark is refused.
        """
        path, whole = folder / FILE, 0
        self.known: dict[str, Entry] = {}
        path.touch()
        self._file: IO[bytes] = path.open("r+b")
        for number, text in enumerate(self._file):
            if not text.endswith(b"\n"):
                break  # broken off while it was written
            if resume:
                self._take(text, mark, f"{path}: line {number + 1}")
                whole += len(text)
            elif number:  # what loops cost is not thrown away unasked
                raise InputError(
                    "holds a survey",
                    where=str(folder),
                    fix="--resume goes on with it, or choose another --out",
                )
        self._file.seek(whole)
        self._file.truncate()
        if not whole:
            self._write({"survey": 1, "options": mark})

    def _take(self, text: bytes, mark: str, where: str) -> None:
        """Take in a line that is there: what the options were, or a loop."""
        try:
            line = json.loads(text)
            other = "survey" in line and line["options"] != mark
            if "survey" not in line:
                self.known[line["key"]] = Entry.from_line(line["entry"])
        except (KeyError, TypeError, ValueError):
            raise InputError(
                "is no result of a survey",
                where=where,
                fix="remove the file, or choose another --out",
            ) from None
        if other:
            raise InputError(
                "was written with other options",
                where=where,
                fix="use the same ones, or choose another --out",
            )

    def add(self, key: str, entry: Entry) -> None:
        """Keep a loop."""
        self.known[key] = entry
        self._write({"key": key, "entry": dataclasses.asdict(entry)})

    def _write(self, line: Any) -> None:
        self._file.write(json_text(line, indent=None).encode() + b"\n")
        self._file.flush()

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


def key_of(loop: Loop) -> str:
    """Return what tells a loop with its files as they are now from all others."""
    parts: list[Any] = [loop.name]
    for file in loop.files:
        status = file.stat() if file.exists() else None
        parts.append([str(file), *([status.st_size, status.st_mtime_ns] if status else [])])
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:20]
