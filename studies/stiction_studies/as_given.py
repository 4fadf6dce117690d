"""One record from one file, as it is: nothing is repaired but jitter and short holes in time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from stiction_ros.errors import InputError, foreign
from stiction_ros.intake.intake import is_bag, one_loop
from stiction_ros.intake.intake_options import CsvColumns, IntakeOptions, OpUnit, TimeUnit
from stiction_ros.intake.sheets.sheet import Sheet
from stiction_ros.intake.sheets.typed import open_sheets
from stiction_ros.records.csv_names import tagged_columns
from stiction_ros.records.parts import only_part
from stiction_ros.records.record import Record
from stiction_ros.records.run.bag_reader import read_bag_parts


def read_csv(
    path: str | Path,
    *,
    op: Mapping[str, str] | None = None,
    pv: Mapping[str, str] | None = None,
    sp: Mapping[str, str] | None = None,
    stem: Mapping[str, str] | None = None,
    time: str | None = None,
) -> Record:
    """Read a table with a header: CSV, packed or not, workbook, Parquet.

    Times are taken in seconds or as dates (those without a zone as UTC), OP in its own unit.
    Other columns are ignored, but for MODE and the qualities that
    :func:`stiction_ros.records.csv_writer.write_csv` writes. With semicolons or tabs the decimal
    sign may be a comma.

    Args:
        path: the file.
        op: see :class:`CsvColumns`, as the others.
        pv: …
        sp: …
        stem: …
        time: …

    Raises:
        InputError: no such file or column; a cell that is empty, not a number or not
            finite; time that does not increase, is irregular or has gaps; fewer than two
            rows.
    """
    return only_part(read_csv_parts(path, CsvColumns(op, pv, sp, stem, time)), str(path))


def read_csv_parts(
    path: str | Path,
    columns: CsvColumns = CsvColumns(),  # noqa: B008 (frozen)
) -> tuple[Record, ...]:
    """Read a table as :func:`read_csv` does, split where it has gaps.

    A step of more than 5.5 usual ones is a gap. Rows whose times are slightly irregular are
    a sample each, see :func:`stiction_ros.records.regular.regular_part`; the notes of each
    record say what was done.

    Raises:
        InputError: as :func:`read_csv` but for gaps.
    """
    with foreign(path):
        named = _named(open_sheets(Path(path))[0], columns)
    options = IntakeOptions(
        columns=named, strict=True, op_unit=OpUnit.OTHER, time_unit=TimeUnit.SECONDS
    )
    return one_loop(Path(path), options).parts


def _named(sheet: Sheet, columns: CsvColumns) -> CsvColumns:
    """Return the columns with every signal that is there named, so that nothing is asked."""
    written = tagged_columns(sheet.layout.given)
    plain = {"op": "V1", "pv": "PV1", "sp": "PV1", "stem": "V1"}
    found: dict[str, Mapping[str, str]] = {}
    for signal, tag in plain.items():
        whole = "op" if signal in ("op", "stem") else "pv"
        given = getattr(columns, signal)
        if given is None and getattr(columns, whole) is None:
            needed = signal == whole or sheet.find(signal.upper()) is not None
            given = written.get(signal) or ({tag: signal.upper()} if needed else None)
        found[signal] = given or {}
    return CsvColumns(**found, time=columns.time)


def open_record(
    path: str | Path,
    columns: CsvColumns = CsvColumns(),  # noqa: B008 (frozen)
    *,
    namespace: str | None = None,
) -> Record:
    """Read a record without gaps from a CSV file or a bag.

    Args:
        path: a CSV file, a rosbag2 directory or a ``.mcap`` file.
        columns: which column is what, for CSV files only.
        namespace: of the loop's topics, for bags that hold several loops.

    Raises:
        InputError: as :func:`open_parts`; gaps, several runs, bad samples.
    """
    return only_part(open_parts(path, columns, namespace=namespace), str(path))


def open_parts(
    path: str | Path,
    columns: CsvColumns = CsvColumns(),  # noqa: B008 (frozen)
    *,
    namespace: str | None = None,
) -> tuple[Record, ...]:
    """Read the records of a CSV file or a bag, one for each stretch without a gap.

    Args:
        path: a CSV file, a rosbag2 directory or a ``.mcap`` file.
        columns: which column is what, for CSV files only.
        namespace: of the loop's topics, for bags that hold several loops.

    Raises:
        InputError: as :func:`read_csv_parts` and :func:`read_bag_parts`; columns given for a
            bag, a namespace given for a CSV file.
    """
    if is_bag(path) or Path(path).is_dir():
        if columns != CsvColumns():
            raise InputError(
                "is a bag, which has no columns",
                where=str(path),
                fix="leave --op, --pv, --sp, --stem and --time out",
            )
        return read_bag_parts(path, namespace=namespace)
    if namespace is not None:
        raise InputError(
            "is a CSV file, which has no namespaces",
            where=str(path),
            fix="leave --namespace out",
        )
    return read_csv_parts(path, columns)
