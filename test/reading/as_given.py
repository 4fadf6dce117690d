"""One record from one file, as it is: nothing is repaired but jitter and short holes in time."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from stiction_ros.errors import InputError, foreign
from stiction_ros.intake.intake import is_bag, one_loop
from stiction_ros.intake.intake_options import CsvColumns, IntakeOptions, OpUnit, TimeUnit
from stiction_ros.intake.sheets.typed import open_sheets
from stiction_ros.records.bag.run_metadata import merged
from stiction_ros.records.csv_writer import tagged_columns
from stiction_ros.records.record import Record
from stiction_ros.records.run.loop_runs import read_bag_parts
from stiction_ros.records.storage.files import storage_files
from stiction_ros.records.storage.mcap_scan import McapScan


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
        op, pv, sp, stem, time: see :class:`CsvColumns`.

    Raises:
        InputError: no such file or column; a cell that is empty, not a number or not
            finite; time that does not increase or is irregular; fewer than two rows.
    """
    (only,) = read_csv_parts(path, CsvColumns(op, pv, sp, stem, time))
    return only


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
        columns = _named(open_sheets(Path(path))[0].layout.given, columns)
    unit, seconds = OpUnit.OTHER, TimeUnit.SECONDS
    options = IntakeOptions(columns=columns, strict=True, op_unit=unit, time_unit=seconds)
    return one_loop(Path(path), options).parts


def _named(header: Sequence[str], columns: CsvColumns) -> CsvColumns:
    """Return the columns with every signal that is there named, so that nothing is asked."""
    usual = {"op": {"V1": "OP"}, "pv": {"PV1": "PV"}, "sp": {"PV1": "SP"}, "stem": {"V1": "STEM"}}
    found = dict(tagged_columns(header)) or {
        key: named for key, named in usual.items() if key in ("op", "pv") or key.upper() in header
    }
    for key, after in (("op", "stem"), ("pv", "sp")):
        if getattr(columns, key) is not None:
            found[key], found[after] = getattr(columns, key), {}
    given = {key: getattr(columns, key) for key in ("sp", "stem") if getattr(columns, key)}
    return CsvColumns(**{**found, **given}, time=columns.time)


def open_record(
    path: str | Path,
    columns: CsvColumns = CsvColumns(),  # noqa: B008 (frozen)
    *,
    namespace: str | None = None,
) -> Record:
    """Read a record without gaps from a CSV file or a bag, as :func:`open_parts` does.

    Raises:
        InputError: as there.
    """
    (only,) = open_parts(path, columns, namespace=namespace)
    return only


def open_parts(
    path: str | Path,
    columns: CsvColumns = CsvColumns(),  # noqa: B008 (frozen)
    *,
    namespace: str | None = None,
) -> tuple[Record, ...]:
    """Read the records of a CSV file or a bag, one for each stretch without a gap.

    A file may have ``columns`` that are named, a bag a loop's ``namespace``.

    Raises:
        InputError: as :func:`read_csv_parts` and :func:`read_bag_parts`; columns given for a
            bag, a namespace given for a CSV file.
    """
    if is_bag(path) or Path(path).is_dir():
        if columns != CsvColumns():
            said = "is a bag, which has no columns"
            raise InputError(said, where=str(path), fix="leave --op, --pv … out")
        return read_bag_parts(path, namespace=namespace)
    if namespace is not None:
        said = "is a CSV file, which has no namespaces"
        raise InputError(said, where=str(path), fix="leave --namespace out")
    return read_csv_parts(path, columns)


def run_metadata(path: Path) -> dict[str, str]:
    """Return what a bag says of its run."""
    found: list[tuple[str, dict[str, str]]] = []
    for file in storage_files(path):
        scan = McapScan(file)
        list(scan.messages())
        found += scan.metadata
    return merged(found)
