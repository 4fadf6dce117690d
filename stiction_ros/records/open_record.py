"""Opens a record, whatever it is kept in."""

from __future__ import annotations

from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.records.bag_reader import read_bag_parts
from stiction_ros.records.csv_file import CsvColumns, read_csv_parts
from stiction_ros.records.parts import longest_part, only_part
from stiction_ros.records.record import Record


def is_bag(path: str | Path) -> bool:
    """Tell whether ``path`` is a bag: a directory or a ``.mcap`` file."""
    path = Path(path)
    return path.is_dir() or path.suffix.lower() == ".mcap"


def read(
    path: str | Path,
    columns: CsvColumns = CsvColumns(),  # noqa: B008 (frozen)
    *,
    namespace: str | None = None,
) -> Record:
    """Read a record from a CSV file or a bag: of one with gaps the longest good part.

    Args:
        path: a CSV file, a rosbag2 directory or a ``.mcap`` file.
        columns: which column is what, for CSV files only; None of them for t, OP, PV, SP, STEM.
        namespace: of the loop's topics, for bags that hold several loops.

    Returns:
        OP and stem in %, shape (N, m); PV and SP in engineering units, shape (N, p). What was
        left out or mended stands in its ``notes``.

    Raises:
        InputError: as :func:`open_parts`; no good samples.

    Examples:
        >>> from stiction_ros import LoopModel, find_config, read, simulate, write_csv
        >>> write_csv(simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=9), "f.csv")
        >>> record = read("f.csv")
        >>> len(record), record.valves, record.sample_time
        (9, ('V1',), 1.0)
    """
    return longest_part(open_parts(path, columns, namespace=namespace))


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
    if is_bag(path):
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
