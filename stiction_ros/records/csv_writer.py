"""Writes a record as a CSV file that :func:`read_csv` reads back, digit by digit."""

from __future__ import annotations

import csv
from pathlib import Path

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.records.csv_file import DEFAULT_OUTPUT, DEFAULT_VALVE
from stiction_ros.records.record import Record

_SIGNALS = (("op", "OP"), ("pv", "PV"), ("sp", "SP"), ("stem", "STEM"))


def write_csv(record: Record, path: str | Path) -> tuple[str, ...]:
    """Write ``record`` with a column of seconds and one column per signal.

    A loop of one valve V1 and one output PV1 gets the default names ``t,OP,PV[,SP][,STEM]``;
    any other gets ``TAG.OP``, ``TAG.PV`` ….

    Returns:
        The options by which the command reads the file, such as ``--op``, ``V1=V1.OP``;
        none where the names are the default ones.

    Raises:
        InputError: the file cannot be written.
    """
    plain = (record.valves, record.outputs) == ((DEFAULT_VALVE,), (DEFAULT_OUTPUT,))
    header, columns, options = ["t"], [record.start + record.time], []
    for key, name in _SIGNALS:
        values: FloatArray | None = getattr(record, key)
        if values is None:
            continue
        tags = record.valves if key in ("op", "stem") else record.outputs
        for tag, column in zip(tags, values.T, strict=True):
            header.append(name if plain else f"{tag}.{name}")
            columns.append(column)
            if not plain:
                options += [f"--{key}", f"{tag}={tag}.{name}"]
    try:
        with Path(path).open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(header)
            writer.writerows(zip(*(map(repr, c.tolist()) for c in columns), strict=True))
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", where=str(path)) from None
    return tuple(options)
