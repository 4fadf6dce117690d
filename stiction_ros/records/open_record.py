"""Opens a record, whatever it is kept in."""

from __future__ import annotations

from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.records.bag_reader import read_bag
from stiction_ros.records.csv_file import CsvColumns, read_csv
from stiction_ros.records.record import Record


def is_bag(path: str | Path) -> bool:
    """Tell whether ``path`` is a bag: a directory or a ``.mcap`` file."""
    path = Path(path)
    return path.is_dir() or path.suffix.lower() == ".mcap"


def open_record(
    path: str | Path,
    columns: CsvColumns = CsvColumns(),  # noqa: B008 (frozen)
    *,
    namespace: str | None = None,
) -> Record:
    """Read a record from a CSV file or a bag.

    Args:
        path: a CSV file, a rosbag2 directory or a ``.mcap`` file.
        columns: which column is what, for CSV files only.
        namespace: of the loop's topics, for bags that hold several loops.

    Raises:
        InputError: as :func:`read_csv` and :func:`read_bag`; columns given for a bag,
            a namespace given for a CSV file.
    """
    if is_bag(path):
        if columns != CsvColumns():
            raise InputError(
                "is a bag, which has no columns",
                where=str(path),
                fix="leave --op, --pv, --sp, --stem and --time out",
            )
        return read_bag(path, namespace=namespace)
    if namespace is not None:
        raise InputError(
            "is a CSV file, which has no namespaces",
            where=str(path),
            fix="leave --namespace out",
        )
    return read_csv(
        path,
        op=columns.op,
        pv=columns.pv,
        sp=columns.sp,
        stem=columns.stem,
        time=columns.time,
    )
