"""What a user may say about exports; everything has a default."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from stiction_ros.records.csv_file import CsvColumns


@dataclasses.dataclass(frozen=True)
class IntakeOptions:
    """How exports are to be read.

    Attributes:
        columns: which column is what, for files of one loop.
        namespace: of the loop's topics, for bags that hold several loops.
        tags: file that lists which tags make up which loop; None finds them by their names.
        strict: whether anything that had to be repaired is a problem.
    """

    columns: CsvColumns = CsvColumns()
    namespace: str | None = None
    tags: Path | None = None
    strict: bool = False
