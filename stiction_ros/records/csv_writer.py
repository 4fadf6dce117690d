"""Writes a record as a CSV file that is read back, digit by digit."""

import csv
import datetime
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from stiction_ros.errors import InputError, storing
from stiction_ros.records.record import Quality, Record

DEFAULT_VALVE = "V1"
DEFAULT_OUTPUT = "PV1"
SIGNALS = {"op": "OP", "pv": "PV", "sp": "SP", "stem": "STEM"}
"""Signal of a record to the last part of its columns' names, in the order of the file."""

QUALITY = "QUALITY"  # column with the quality of each sample, written where not all are good
MODE = "MODE"  # column with the mode of the loop's controller, before that of the quality
_KEYS = {name: key for key, name in SIGNALS.items()}


def write_csv(
    record: Record, path: str | Path, *, iso: bool = False, modes: Sequence[str] | None = None
) -> None:
    """Write ``record`` with a column of seconds and one column per signal.

    A loop of one valve V1 and one output PV1 gets the default names ``t,OP,PV[,SP][,STEM]``;
    any other gets ``TAG.OP``, ``TAG.PV`` …. Where not every sample is good a column ``QUALITY``
    says what each is, and NaN is an empty cell. Either is read back without naming a column;
    runs of blanks in a tag come back as one.

    Args:
        record: to write.
        path: the file.
        iso: time as ISO 8601 stamps in UTC, to the microsecond, instead of seconds.
        modes: of the loop's controller, one a sample, for a column ``MODE``; when it is read,
            what is not automatic is marked as manual.

    Raises:
        InputError: the file cannot be written, no ISO stamp can say its times, or it holds
            several runs.

    Examples:
        >>> from stiction_ros import LoopModel, find_config, read, simulate, write_csv
        >>> record = simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=20)
        >>> write_csv(record, "flow.csv")
        >>> bool((read("flow.csv").pv == record.pv).all())
        True
    """
    if (np.diff(record.time) <= 0).any():
        raise InputError(
            "holds several runs, whose times fall back",
            where=record.name,
            fix="write each of its segments by itself",
        )
    plain = (record.valves, record.outputs) == ((DEFAULT_VALVE,), (DEFAULT_OUTPUT,))
    times = _iso(record) if iso else [repr(t) for t in (record.start + record.time).tolist()]
    header, columns = ["t"], [times]
    for key, values in record.signals.items():
        for tag, column in zip(record.tags(key), values.T, strict=True):
            header.append(SIGNALS[key] if plain else column_name(key, tag))
            columns.append(["" if math.isnan(x) else repr(x) for x in column.tolist()])
    if modes is not None:
        header.append(MODE)
        columns.append(list(modes))
    if record.mask is not None:
        header.append(QUALITY)
        columns.append([Quality(number).word for number in record.mask.tolist()])
    with storing(path), Path(path).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        quoted = csv.writer(file, lineterminator="\n", quoting=csv.QUOTE_ALL)
        # A semicolon in a name must not be taken for what separates the columns.
        (quoted if ";" in "".join(header) else writer).writerow(header)
        writer.writerows(zip(*columns, strict=True))


def _iso(record: Record) -> list[str]:
    try:
        begin = datetime.datetime.fromtimestamp(record.start, datetime.UTC)
        stamps = [begin + datetime.timedelta(seconds=t) for t in record.time.tolist()]
    except (ValueError, OverflowError, OSError):
        raise InputError(
            f"{record.start:.9g} s is no date", where=record.name, fix="write seconds"
        ) from None
    return [stamp.isoformat().replace("+00:00", "Z") for stamp in stamps]


def column_name(key: str, tag: str) -> str:
    """Return ``TAG.OP``, ``TAG.PV``, ``TAG.SP`` or ``TAG.STEM``."""
    return f"{tag}.{SIGNALS[key]}"


def tagged_columns(header: Sequence[str]) -> Mapping[str, Mapping[str, str]]:
    """Return signal to tag to column of a ``header`` that ``write_csv`` wrote; empty for others.

    It is the time, OP of every valve, PV of every output and, where they are known, SP of the
    same outputs and the stems of the same valves, each in the same order, and perhaps mode and
    quality.
    """
    found: dict[str, dict[str, str]] = {key: {} for key in SIGNALS}
    for last in (QUALITY, MODE):
        header = header[:-1] if header and header[-1] == last else header
    for column in header[1:]:
        tag, _, name = column.rpartition(".")
        if not tag or name not in _KEYS:
            return {}
        found[_KEYS[name]][tag] = column
    op, pv, sp, stem = (list(found[key]) for key in SIGNALS)
    written = [column_name(key, tag) for key, tags in found.items() for tag in tags]
    whole = op and pv and sp in ([], pv) and stem in ([], op)
    return found if whole and written == list(header[1:]) else {}
