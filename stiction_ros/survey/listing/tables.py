"""The list as CSV and XLSX, for the maintenance system."""

import csv
from collections.abc import Sequence
from pathlib import Path

from stiction_ros.survey.entry import Entry, Status
from stiction_ros.survey.listing.headline import HEADS, change
from stiction_ros.survey.pages.words import cause_words

Cell = str | float | int | None

FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")  # how a formula of a spreadsheet begins


def row_of(entry: Entry) -> dict[str, Cell]:
    """Return heading to cell of a loop; no text in it is a formula to a spreadsheet."""
    cycle, gain = entry.oscillation, entry.gain or {}
    low, high = entry.f_s_interval or (None, None)
    now = (gain.get("now") or {}).get("iae_per_hour")
    changes = {f"{head} %": change(entry, what) for what, head in HEADS.items()}
    found: dict[str, Cell] = {
        "rank": entry.rank,
        "loop": entry.name,
        "status": entry.status.value,
        "verdict": entry.verdict,
        "cycles by": cause_words(entry.cause) or None,
        "probability": entry.probability,
        "f_S": entry.f_s,
        "f_S low": low,
        "f_S high": high,
        "f_D": entry.f_d,
        "unit of OP": None if entry.f_s is None else entry.op_unit,
        "band share of OP": entry.band_share,
        "period s": None if cycle is None else cycle.period,
        "amplitude": None if cycle is None else cycle.amplitude,
        "travel/h": entry.travel_per_hour,
        "reversals/h": entry.reversals_per_hour,
        "|PV−SP| now": None if now is None else float(now),
        **{head: None if one is None else 100.0 * one for head, one in changes.items()},
        "cost per hour": entry.cost_per_hour,
        "group": entry.group,
        "reason": entry.reason or None,
        "page": entry.report,
    }
    texts = {k for k, cell in found.items() if isinstance(cell, str) and cell.startswith(FORMULA)}
    return {head: f"'{cell}" if head in texts else cell for head, cell in found.items()}


HEAD = tuple(row_of(Entry("", (), Status.OK)))


def write_csv(path: Path, entries: Sequence[Entry]) -> None:
    """Write the list as CSV, UTF-8 with a mark that spreadsheets know it by."""
    with path.open("w", encoding="utf-8-sig", newline="") as file:
        writer = csv.writer(file, lineterminator="\r\n")
        writer.writerow(HEAD)
        for entry in entries:
            writer.writerow([_short(cell) for cell in row_of(entry).values()])


def write_xlsx(path: Path, entries: Sequence[Entry]) -> None:
    """Write the list as a workbook of one sheet, its head frozen and with filters.

    It takes openpyxl, of the extra ``survey``.
    """
    import openpyxl
    from openpyxl.cell.cell import ILLEGAL_CHARACTERS_RE

    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "loops"
    for row in (HEAD, *(row_of(entry).values() for entry in entries)):
        legal = [ILLEGAL_CHARACTERS_RE.sub("", c) if isinstance(c, str) else c for c in row]
        sheet.append(legal)
    sheet.freeze_panes, sheet.auto_filter.ref = "C2", sheet.dimensions
    sheet.column_dimensions["B"].width = 24
    book.save(path)


def _short(value: Cell | None) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
