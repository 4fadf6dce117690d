"""The list as CSV and XLSX, for the maintenance system."""

import csv
import io
import zipfile
from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import escape

from stiction_ros.survey.entry import Entry, Status
from stiction_ros.survey.listing.headline import HEADS, change
from stiction_ros.survey.pages.words import cause_words

Cell = str | float | int | None

FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")  # how a formula of a spreadsheet begins
STAMP = (1980, 1, 1, 0, 0, 0)  # time of the files inside the XLSX: the same list is the same file

_TYPES = """<?xml version="1.0" encoding="UTF-8" standalone="yes"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="xml" ContentType="application/xml"/>
<Override PartName="/xl/workbook.xml" ContentType=\
"application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/>
<Override PartName="/xl/worksheets/sheet1.xml" ContentType=\
"application/vnd.openxmlformats-officedocument.spreadsheetml.worksheet+xml"/>
</Types>"""

_PART = """<?xml version="1.0" encoding="UTF-8" standalone="yes"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Id="r1" Type=\
"http://schemas.openxmlformats.org/officeDocument/2006/relationships/{kind}" Target="{target}"/>
</Relationships>"""

_BOOK = """<?xml version="1.0" encoding="UTF-8" standalone="yes"?>
<workbook xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main" xmlns:r=\
"http://schemas.openxmlformats.org/officeDocument/2006/relationships">
<sheets><sheet name="loops" sheetId="1" r:id="r1"/></sheets></workbook>"""

_SHEET = """<?xml version="1.0" encoding="UTF-8" standalone="yes"?>
<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main">
<sheetViews><sheetView workbookViewId="0"><pane xSplit="2" ySplit="1" topLeftCell="C2" \
state="frozen"/></sheetView></sheetViews>
<cols><col min="1" max="1" width="7" customWidth="1"/>\
<col min="2" max="2" width="24" customWidth="1"/></cols>
<sheetData>{rows}</sheetData><autoFilter ref="A1:{last}"/></worksheet>"""


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
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(HEAD)
    for entry in entries:
        writer.writerow([_short(cell) for cell in row_of(entry).values()])
    path.write_text(text.getvalue(), encoding="utf-8-sig", newline="")


def write_xlsx(path: Path, entries: Sequence[Entry]) -> None:
    """Write the list as a workbook of one sheet (ECMA-376), its head frozen and with filters."""
    table: list[list[Cell]] = [list(HEAD), *[list(row_of(entry).values()) for entry in entries]]
    rows = "".join(_row(number, row) for number, row in enumerate(table, start=1))
    sheet = _SHEET.format(rows=rows, last=f"{_column(len(HEAD))}{len(table)}")
    parts = {
        "[Content_Types].xml": _TYPES,
        "_rels/.rels": _PART.format(kind="officeDocument", target="xl/workbook.xml"),
        "xl/workbook.xml": _BOOK,
        "xl/_rels/workbook.xml.rels": _PART.format(
            kind="worksheet", target="worksheets/sheet1.xml"
        ),
        "xl/worksheets/sheet1.xml": sheet,
    }
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as book:
        for name, content in parts.items():
            info = zipfile.ZipInfo(name, STAMP)
            info.compress_type = zipfile.ZIP_DEFLATED
            book.writestr(info, content)


def _row(number: int, row: Sequence[Cell]) -> str:
    made = []
    for column, value in enumerate(row, start=1):
        place = f"{_column(column)}{number}"
        if isinstance(value, str):
            text = escape("".join(c for c in value if c >= " " or c in "\t\n"))
            made.append(f'<c r="{place}" t="inlineStr"><is><t>{text}</t></is></c>')
        elif value is not None:
            made.append(f'<c r="{place}"><v>{value!r}</v></c>')
    return f'<row r="{number}">{"".join(made)}</row>'


def _column(number: int) -> str:
    """Return the letters of a column, from 1."""
    letters = ""
    while number:
        number, rest = divmod(number - 1, 26)
        letters = chr(ord("A") + rest) + letters
    return letters


def _short(value: Cell | None) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
