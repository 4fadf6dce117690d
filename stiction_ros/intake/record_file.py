"""The longest good record of one export or bag."""

import os
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.intake.intake import is_bag, one_loop
from stiction_ros.intake.intake_options import CsvColumns, IntakeOptions
from stiction_ros.records.parts import longest_part
from stiction_ros.records.record import Record

__all__ = ["CsvColumns", "is_bag", "read"]

NO_RECORD = (
    "give a Record: Record.from_arrays(time, op, pv), Record.from_dataframe(frame, op, pv), or "
    "the path of a file"
)
"""What helps where something else than a record was given."""


def record_of(given: Record | str | os.PathLike[str]) -> Record:
    """Return a record, read from a file where its path is given; InputError for anything else."""
    if isinstance(given, Record):
        return given
    if isinstance(given, str | os.PathLike):
        return read(os.fspath(given))
    raise InputError(f"{type(given).__name__} is no record", where="record", fix=NO_RECORD)


def read(
    path: str | Path,
    columns: CsvColumns = CsvColumns(),  # noqa: B008 (frozen)
    *,
    namespace: str | None = None,
) -> Record:
    """Read a record from an export or a bag: of one with gaps the longest good part.

    Args:
        path: a CSV file or another export of one loop, a rosbag2 directory or a ``.mcap`` file.
        columns: which column is what, for files only; None of them for t, OP, PV, SP, STEM.
        namespace: of the loop's topics, for bags that hold several loops.

    Returns:
        OP and stem in %, shape (N, m); PV and SP in engineering units, shape (N, p). What was
        left out or mended stands in its ``notes``.

    Raises:
        InputError: no such file or column, columns that cannot be told apart, no good samples.

    Examples:
        >>> from stiction_ros import LoopModel, find_config, read, simulate, write_csv
        >>> write_csv(simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=9), "f.csv")
        >>> record = read("f.csv")
        >>> len(record), record.valves, record.sample_time
        (9, ('V1',), 1.0)
    """
    options = IntakeOptions(columns=columns, namespace=namespace)
    return longest_part(one_loop(Path(path), options).parts)
