"""Names of the columns of CSV files that this package writes, and how they are told again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

DEFAULT_VALVE = "V1"
DEFAULT_OUTPUT = "PV1"
SIGNALS = {"op": "OP", "pv": "PV", "sp": "SP", "stem": "STEM"}
"""Signal of a record to the last part of its columns' names, in the order of the file."""

QUALITY = "QUALITY"  # column with the quality of each sample, written where not all are good
MODE = "MODE"  # column with the mode of the loop's controller, before that of the quality

_KEYS = {name: key for key, name in SIGNALS.items()}


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
