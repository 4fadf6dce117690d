"""What stands in the columns of a table: stamps, numbers, texts."""

from __future__ import annotations

import re
from collections import Counter

import numpy as np

from stiction_ros.intake.sheets.cells import Cells, is_number
from stiction_ros.intake.sheets.names import TIME_NAMES, read_tag
from stiction_ros.intake.sheets.stamps import is_stamp


def kind_of(cells: Cells) -> str:
    """Return what most cells of a column are: stamp, number, text; empty when nothing is there."""
    if isinstance(cells, np.ndarray):
        return "stamp" if cells.dtype.kind == "M" else "number"
    counts = Counter(
        "stamp" if is_stamp(cell) else "number" if is_number(cell) else "text"
        for cell in cells[:: max(len(cells) // 100, 1)]
        if cell.strip()
    )
    return counts.most_common(1)[0][0] if counts else ""


def repeats(cells: Cells) -> bool:
    """Return whether each cell of a column is there twice on average."""
    return 2 * len(set(cells)) <= len(cells)


def is_clock(name: str, cells: Cells) -> bool:
    """Return whether a column holds stamps, or numbers under the name of a time."""
    if (told := read_tag(name)) is not None and not told.quality:
        return False
    kind = kind_of(cells)
    bare = re.sub(r"[\s._(#-]*\d*\)?$", "", name).casefold()
    return kind == "stamp" or (kind == "number" and bare in TIME_NAMES)
