"""Results as they come, a line each, from which a survey that was broken off goes on."""

import dataclasses
import hashlib
import itertools
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
        self.path = folder / FILE
        self.known: dict[str, Entry] = {}
        if resume and self.path.exists():
            whole = self._read(mark)
            self._file: IO[bytes] = self.path.open("r+b")
            self._file.seek(whole)
            self._file.truncate()
        else:
            _refuse_loops(self.path)
            self._file = self.path.open("wb")
        if not self._file.tell():
            self._write({"survey": 1, "options": mark})

    def _read(self, mark: str) -> int:
        """Take in what is there, and return the bytes of its whole lines."""
        where, whole = str(self.path), 0
        with self.path.open("rb") as file:
            for number, text in enumerate(file):
                if not text.endswith(b"\n"):
                    break  # broken off while it was written
                try:
                    line = json.loads(text)
                    if number:
                        self.known[line["key"]] = Entry.from_line(line["entry"])
                except (json.JSONDecodeError, KeyError, TypeError, ValueError):
                    raise InputError(
                        f"line {number + 1} is no result of a survey",
                        where=where,
                        fix="remove the file, or choose another --out",
                    ) from None
                if not number:
                    _check(line, mark, where)
                whole += len(text)
        return whole

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


def _refuse_loops(path: Path) -> None:
    """Raise where loops are kept: what they cost is not thrown away unasked."""
    if not path.exists():
        return
    with path.open("rb") as file:
        if sum(1 for _ in itertools.islice(file, 2)) == 2:
            raise InputError(
                "holds a survey",
                where=str(path.parent),
                fix="--resume goes on with it, or choose another --out",
            )


def _check(line: Any, mark: str, where: str) -> None:
    if not isinstance(line, dict) or line.get("survey") != 1:
        raise InputError("was not written by a survey", where=where, fix="name another folder")
    if line.get("options") != mark:
        raise InputError(
            "was written with other options",
            where=where,
            fix="use the same ones, or choose another --out",
        )
