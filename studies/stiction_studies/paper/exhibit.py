"""One figure or table of the paper: what it prints, and what comes out here."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Row:
    """One number, or one claim, beside ours.

    Attributes:
        what: in words.
        printed: as the paper has it; empty where it has none.
        ours: what came out here.
        remark: a misprint, a deviation, or the reason for one.
    """

    what: str
    printed: str
    ours: str
    remark: str = ""


@dataclasses.dataclass(frozen=True)
class Exhibit:
    """A figure or a table.

    Attributes:
        name: of the option that asks for it, such as ``figure2`` or ``tableA.3``.
        title: heading.
        rows: numbers side by side.
        figures: HTML; empty for a table.
        remark: what holds for all of it.
    """

    name: str
    title: str
    rows: tuple[Row, ...] = ()
    figures: str = ""
    remark: str = ""
