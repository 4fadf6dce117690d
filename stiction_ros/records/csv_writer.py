"""Writes a record as a CSV file that :func:`stiction_ros.records.csv_file.read_csv` reads."""

from __future__ import annotations

import csv
from pathlib import Path

from stiction_ros.records.csv_file import DEFAULT_OUTPUT, DEFAULT_VALVE
from stiction_ros.records.record import Record


def write_csv(record: Record, path: str | Path) -> None:
    """Write ``t`` in seconds and every signal in full precision.

    A record of V1 and PV1 alone gets the default columns ``OP``, ``PV``, ``SP`` and ``STEM``;
    any other has columns such as ``V1.OP``.

    Raises:
        OSError: the file cannot be written.
    """
    plain = record.valves == (DEFAULT_VALVE,) and record.outputs == (DEFAULT_OUTPUT,)
    signals = (
        ("OP", record.valves, record.op),
        ("PV", record.outputs, record.pv),
        ("SP", record.outputs, record.sp),
        ("STEM", record.valves, record.stem),
    )
    header, columns = ["t"], [record.time]
    for kind, tags, values in signals:
        if values is not None:
            header += [kind if plain else f"{tag}.{kind}" for tag in tags]
            columns += list(values.T)
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(zip(*(column.tolist() for column in columns), strict=True))
