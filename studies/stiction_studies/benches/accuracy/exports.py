"""``stiction bench exports``: one loop written as many random exports, read, and compared."""

import argparse
import dataclasses
import enum
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.errors import InputError
from stiction_ros.intake import IntakeOptions, Loop, loops
from stiction_ros.records.record import Quality
from stiction_studies.benches.accuracy.share import Share, shares_table
from stiction_studies.field.exports.random_export import Export, write_random_export
from stiction_studies.seeds import run_seeds

FIRST, LAST = 10_000, 10_199
"""Seeds when none are given; those below 1000 are for tuning."""

DIGITS = 2e-6
"""Share of a value by which it may be off: exports have seven digits."""


class Reading(enum.StrEnum):
    """How an export was read."""

    EQUAL = "equal"
    REFUSED = "refused"
    TOLD = "differs, with a note that says so"
    SILENT = "differs in silence"


@dataclasses.dataclass(frozen=True)
class Read:
    """One export."""

    seed: int  # of it
    drawn: str  # what it is like, in words
    reading: Reading  # how it was read
    said: str  # the reason of a refusal, or what differs and the notes


def judge(seed: int) -> Read:
    """Write one export, read it as ``stiction identify`` does, and compare."""
    with tempfile.TemporaryDirectory() as folder:
        export = write_random_export(seed, Path(folder))
        try:
            found = list(loops(export.files, IntakeOptions()))
        except InputError as error:
            return Read(seed, str(export.drawn), Reading.REFUSED, str(error))
    mine = [loop for loop in found if "TIC7" not in loop.name]
    if len(mine) != 1:
        said = "; ".join(f"{loop.name}: {loop.problem or 'read'}" for loop in mine)
        refused = bool(mine) and all(loop.problem for loop in mine)
        return Read(seed, str(export.drawn), Reading.REFUSED if refused else Reading.SILENT, said)
    if mine[0].problem is not None:
        return Read(seed, str(export.drawn), Reading.REFUSED, mine[0].problem)
    fault = difference(export, mine[0])
    if fault is None:
        return Read(seed, str(export.drawn), Reading.EQUAL, "; ".join(mine[0].notes))
    notes = "; ".join(mine[0].notes)
    told = Reading.TOLD if _confessed(mine[0]) else Reading.SILENT
    return Read(seed, str(export.drawn), told, f"{fault}; notes: {notes or 'none'}")


def _confessed(loop: Loop) -> bool:
    """Return whether a note says that samples are not as they were measured."""
    words = ("brought onto", "instants", "interpolated", "unit", "cut at", "left out")
    return any(word in note for note in loop.notes for word in words)


def difference(export: Export, loop: Loop) -> str | None:
    """Return how the good samples of a loop differ from what was written; None where they do not.

    Args:
        export: and its truth.
        loop: as read.
    """
    seen: list[int] = []
    for part in loop.parts:
        good = np.flatnonzero(part.quality == Quality.GOOD)
        if abs(part.sample_time / export.scan - 1.0) > 1e-3:
            return f"sample time {part.sample_time:.6g} s for {export.scan:.6g} s"
        rows: list[int] = []
        for k in good.tolist():
            after = rows[-1] if rows else (seen[-1] if seen else -1)
            row = _row_of(float(part.op[k, 0]), float(part.pv[k, 0]), export, after)
            if row is None:
                return f"OP {part.op[k, 0]:.6g} and PV {part.pv[k, 0]:.6g} stand in no row"
            if export.bad[row]:
                return f"row {row} of bad quality is good"
            rows.append(row)
        if np.any(np.diff(export.place[rows]) != np.diff(good)):
            return "samples are moved in time"
        seen += rows
    lost = len(export.op) - int(export.bad.sum()) - len(set(seen))
    return f"{lost} rows lost" if lost else None


def _row_of(op: float, pv: float, export: Export, after: int) -> int | None:
    """Return the first row behind another that has both values; None where there is none.

    Args:
        op: in %, which a conversion of the unit rounds ten times as coarsely.
        pv: as written.
        export: and its truth.
        after: the row before.
    """
    near = np.abs(export.op - op) <= 10.0 * DIGITS * 100.0
    near &= np.abs(export.pv - pv) <= DIGITS * np.abs(export.pv)
    rows = np.flatnonzero(near)
    rows = rows[rows > after]
    return int(rows[0]) if len(rows) else None


def run(options: argparse.Namespace, machine: str) -> int:
    """Run the benchmark; exit code 1 where one differs in silence."""
    rows = run_seeds(judge, options.seeds or (FIRST, LAST), options.jobs or 1, "exports")
    document = {
        "name": "exports",
        "machine": machine,
        "rows": [],
        "exports": [dataclasses.asdict(row) for row in rows],
    }
    hand_over(options.json, document, lambda: show(rows))
    return int(any(row.reading is Reading.SILENT for row in rows))


def show(rows: Sequence[Read]) -> None:
    """Print how often exports are read as written, and each that is not."""
    counts: Counter[Any] = Counter(row.reading for row in rows)
    console = Console()
    wanted = {Reading.SILENT: "0"}
    console.print(
        shares_table(Share(r.value, counts[r], len(rows), wanted.get(r, "")) for r in Reading)
    )
    for row in rows:
        if row.reading is not Reading.EQUAL:
            console.print(f"{row.seed} ({row.drawn}): {row.reading}: {row.said}", highlight=False)
