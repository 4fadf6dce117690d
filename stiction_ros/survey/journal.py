"""The folder of a survey: results as they come, what was decided of each loop, and pages."""

import dataclasses
import hashlib
import itertools
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

from stiction_ros.errors import InputError
from stiction_ros.intake.loop import Loop
from stiction_ros.survey.entry import Entry
from stiction_ros.texts import json_text

FILE = "loops.jsonl"
PAGES = "loops"
LOG = "survey.log"


class Journal:
    """Keeps a survey in a folder, from which one that was broken off goes on; or nothing.

    The first line of its file says what the options were, each other one holds a loop.
    """

    def __init__(self, folder: Path | None, mark: str, *, resume: bool) -> None:
        """Open the journal of a folder by the ``mark`` of the options; None keeps nothing.

        What is there counts to ``resume``; else no loop may be there. Another mark is refused.
        """
        self.known: dict[str, Entry] = {}
        self._folder, self._open = folder, list[IO[Any]]()
        if folder is None:
            return
        path, whole = folder / FILE, 0
        (folder / PAGES).mkdir(parents=True, exist_ok=True)
        path.touch()
        self._file = path.open("r+b")
        self._open.append(self._file)
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
        self._log = (folder / LOG).open("a" if resume else "w", encoding="utf-8")
        self._open.append(self._log)
        self._pages = {Path(entry.report).name for entry in self.known.values() if entry.report}

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
        """Keep a loop, from which a survey that goes on takes it."""
        if self._folder is not None:
            self.known[key] = entry
            self._write({"key": key, "entry": dataclasses.asdict(entry)})

    def tell(self, name: str, sentences: Sequence[str]) -> None:
        """Keep what was decided of a loop."""
        if self._folder is None:
            return
        for sentence in sentences:
            line = " ".join(sentence.split())
            self._log.write(f"{name}: {line}\n")
        self._log.flush()

    def with_page(self, entry: Entry, page: str) -> Entry:
        """Write the page of a loop and return the entry that names it."""
        if not page or self._folder is None:
            return entry
        base = re.sub(r"[^\w.-]+", "_", entry.name).strip("._")[:80] or "loop"
        names = itertools.chain([base], (f"{base}-{k}" for k in itertools.count(2)))
        name = next(f"{n}.html" for n in names if f"{n}.html" not in self._pages)
        self._pages.add(name)
        (self._folder / PAGES / name).write_text(page, encoding="utf-8")
        return dataclasses.replace(entry, report=f"{PAGES}/{name}")

    def _write(self, line: Any) -> None:
        self._file.write(json_text(line, indent=None).encode() + b"\n")
        self._file.flush()

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *_: object) -> None:
        for file in self._open:
            file.close()


def key_of(loop: Loop) -> str:
    """Return what tells a loop with its files as they are now from all others."""
    parts: list[Any] = [loop.name]
    for file in loop.files:
        status = file.stat() if file.exists() else None
        parts.append([str(file), *([status.st_size, status.st_mtime_ns] if status else [])])
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:20]
