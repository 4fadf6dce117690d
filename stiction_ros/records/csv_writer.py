"""Writes a record as a CSV file that :func:`read_csv` reads back, digit by digit."""

from __future__ import annotations

import csv
import datetime
from pathlib import Path

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.records.csv_file import DEFAULT_OUTPUT, DEFAULT_VALVE
from stiction_ros.records.record import Record

_SIGNALS = (("op", "OP"), ("pv", "PV"), ("sp", "SP"), ("stem", "STEM"))


def write_csv(record: Record, path: str | Path, *, iso: bool = False) -> tuple[str, ...]:
    """Write ``record`` with a column of seconds and one column per signal.

    A loop of one valve V1 and one output PV1 gets the default names ``t,OP,PV[,SP][,STEM]``;
    any other gets ``TAG.OP``, ``TAG.PV`` ….

    Args:
        record: to write.
        path: the file.
        iso: time as ISO 8601 stamps in UTC, to the microsecond, instead of seconds.

    Returns:
        The options by which the command reads the file, such as ``--op``, ``V1=V1.OP``;
        none where the names are the default ones.

    Raises:
        InputError: the file cannot be written, or no ISO stamp can say its times.
    """
    plain = (record.valves, record.outputs) == ((DEFAULT_VALVE,), (DEFAULT_OUTPUT,))
    times = _iso(record) if iso else [repr(t) for t in (record.start + record.time).tolist()]
    header, columns, options = ["t"], [times], []
    for key, name in _SIGNALS:
        values: FloatArray | None = getattr(record, key)
        if values is None:
            continue
        tags = record.valves if key in ("op", "stem") else record.outputs
        for tag, column in zip(tags, values.T, strict=True):
            header.append(name if plain else f"{tag}.{name}")
            columns.append([repr(value) for value in column.tolist()])
            if not plain:
                options += [f"--{key}", f"{tag}={tag}.{name}"]
    try:
        with Path(path).open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(header)
            writer.writerows(zip(*columns, strict=True))
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", where=str(path)) from None
    return tuple(options)


def _iso(record: Record) -> list[str]:
    try:
        begin = datetime.datetime.fromtimestamp(record.start, datetime.UTC)
        stamps = [begin + datetime.timedelta(seconds=t) for t in record.time.tolist()]
    except (ValueError, OverflowError, OSError):
        raise InputError(
            f"{record.start:.9g} s is no date", where=record.name, fix="write seconds"
        ) from None
    return [stamp.isoformat().replace("+00:00", "Z") for stamp in stamps]
