"""One loop as an export shows it: rows of cells, with what goes wrong in them."""

import dataclasses

import numpy as np

from stiction_ros.records.record import Quality
from stiction_studies.field.field_loop import FieldLoop
from stiction_studies.field.kernels import FloatArray

Cell = float | str | None  # a number, a word in its place, or nothing
WORDS = ("Bad", "I/O Timeout", "No Data", "#N/A", None)  # what stands in the place of a bad value
SENTINEL = -9999.0

# what a mode shows in automatic and by hand
MODES = (("AUTO", "MAN"), ("A", "M"), ("CAS", "MAN"), ("Automatic", "Manual"))
OFTEN = 0.15  # share of the loops that each thing befalls
# circumstance of a loop to the unit that its export says
UNITS = {"op_0_to_1": "0-1", "op_4_to_20": "mA"}


@dataclasses.dataclass(frozen=True)
class Table:
    """Rows of one loop.

    Attributes:
        tag: of the loop.
        time: of each row, seconds since 1970, as they stand in the export.
        cells: signal (``PV``, ``SP``, ``OP``, ``MODE``) to its cells.
        units: signal to its unit.
        step: sample time, s.
        faults: names of what is wrong.
        reported: whether the signals were kept when they changed.
    """

    tag: str
    time: FloatArray
    cells: dict[str, list[Cell]]
    units: dict[str, str]
    step: float
    faults: tuple[str, ...]
    reported: bool

    def rows(self, order: list[int]) -> "Table":
        """Return some rows in some order."""
        cells = {name: [column[k] for k in order] for name, column in self.cells.items()}
        return dataclasses.replace(self, time=self.time[order], cells=cells)

    def changes(self, name: str) -> list[tuple[float, Cell]]:
        """Return stamps and cells of one signal, those that differ from the one before in time.

        They stand in the order of the rows, from the last to the first where those do.
        """
        rows = np.argsort(self.time, kind="stable").tolist()
        column = [self.cells[name][row] for row in rows]
        kept = [
            (float(self.time[row]), cell)
            for k, (row, cell) in enumerate(zip(rows, column, strict=True))
            if k in (0, len(column) - 1) or cell != column[k - 1]
        ]
        return kept[::-1] if "turned" in self.faults else kept


def table_of(random: np.random.Generator, loop: FieldLoop, tag: str, start: float) -> Table:
    """Return a loop as its export shows it.

    Args:
        random: source of what goes wrong.
        loop: of the field.
        tag: of the loop.
        start: of the record, seconds since 1970.
    """
    record = loop.record
    kept = np.flatnonzero(record.quality != Quality.HELD)  # rows that the historian lacks
    cells: dict[str, list[Cell]] = {"PV": _cells(record.pv[kept, 0])}
    if record.sp is not None:
        cells["SP"] = _cells(record.sp[kept, 0])
    cells["OP"] = _cells(record.op[kept, 0])
    automatic, manual = MODES[int(random.integers(len(MODES)))]
    by_hand = record.quality[kept] == Quality.MANUAL
    if by_hand.any() or random.random() < 0.5:
        cells["MODE"] = [manual if hand else automatic for hand in by_hand.tolist()]
    word = WORDS[int(random.integers(len(WORDS)))]
    cells["PV"] = [word if cell is None else cell for cell in cells["PV"]]
    unit = next((UNITS[name] for name in loop.circumstances if name in UNITS), "%")
    units = {"PV": "", "SP": "", "OP": unit, "MODE": ""}
    if "op_centred" in loop.circumstances or "op_span_5" in loop.circumstances:
        units["OP"] = "other"
    table = Table(
        tag=tag,
        time=start + record.time[kept],
        cells=cells,
        units={name: units[name] for name in cells},
        step=record.sample_time,
        faults=(),
        reported="exception" in loop.circumstances,
    )
    return _spoiled(random, table)


def _cells(values: FloatArray) -> list[Cell]:
    return [float(f"{value:.7g}") if np.isfinite(value) else None for value in values.tolist()]


def _spoiled(random: np.random.Generator, table: Table) -> Table:
    """Return the table with what goes wrong in exports."""
    faults = [
        name
        for name in ("sentinels", "words", "blanks", "repeats", "out_of_order", "turned")
        if random.random() < OFTEN
    ]
    count = len(table.time)
    cells = {name: list(column) for name, column in table.cells.items()}

    def some() -> list[int]:
        chosen = random.choice(np.arange(5, count - 5), int(random.integers(1, 4)), False)
        return [int(row) for row in chosen]

    if "sentinels" in faults:
        for row in some():
            cells["PV"][row] = SENTINEL
    if "words" in faults:
        word = WORDS[int(random.integers(len(WORDS) - 1))]
        for row in some():
            cells["PV"][row] = word
    if "blanks" in faults:
        for row in some():
            cells["OP"][row] = None
    order = list(range(count))
    if "repeats" in faults:
        order = sorted([*order, *some()])
    if "out_of_order" in faults:
        for row in some():
            order[row], order[row + 1] = order[row + 1], order[row]
    if "turned" in faults:
        order.reverse()
    return dataclasses.replace(table, cells=cells, faults=tuple(faults)).rows(order)
