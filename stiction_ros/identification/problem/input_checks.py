"""Can a record be worked on, and were OP and PV swapped in it?"""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.records.record import Quality, Record
from stiction_ros.signals.tracking import FEWEST, explained, is_nearer

TOO_SHORT = "take a longer record, lower orders or a narrower delay range"
EXACT = 1e-6  # share of a controller's moves that its own law leaves, at most


def require_signals(record: Record) -> None:
    """Refuse a record with gaps, without valves or outputs, or with a signal that never moves.

    Raises:
        InputError: gaps or bad samples, no valve, no output, or a constant OP or PV.
    """
    require_tags(record)
    require_motion(record, "op", record.op, record.valves)
    require_motion(record, "pv", record.pv, record.outputs)


def require_tags(record: Record) -> None:
    """Refuse a record with gaps or bad samples, or without valves or outputs."""
    if record.gaps or (record.quality == Quality.BAD).any():
        raise InputError(
            "has gaps or bad samples", where=record.name, fix="take one of its good parts"
        )
    if not record.valves or not record.outputs:
        raise InputError("needs at least one valve and one output", where=record.name)


def require_motion(record: Record, what: str, values: FloatArray, tags: tuple[str, ...]) -> None:
    """Refuse columns, shape (N, number of tags), of which one never moves."""
    for tag, column in zip(tags, values.T, strict=True):
        if len(column) and np.ptp(column) <= 1e-9 * max(1.0, float(np.abs(column).max())):
            raise InputError(
                f"{what} of {tag} is constant",
                where=record.name,
                fix="choose a window in which the loop moves",
            )


def require_samples(record: Record, needed: int, fix: str) -> None:
    """Refuse a record of fewer than ``needed`` samples."""
    if len(record) < needed:
        raise InputError(
            f"{len(record)} samples are too few, {needed} are needed", where=record.name, fix=fix
        )


def refuse_swapped(record: Record) -> None:
    """Refuse a record in which every OP looks like the measurement of its loop.

    It needs set-points and as many valves as outputs, in the same order. Columns of files and
    arrays that bear no set-point are judged when they are read.
    """
    if record.sp is None or len(record.valves) != len(record.outputs):
        return
    columns = zip(record.sp.T, record.op.T, record.pv.T, strict=True)
    if record.valves and all(_swapped(*each) for each in columns):
        raise InputError(
            "OP and PV look swapped: the column taken for OP stays near the set-point, or the one "
            "taken for PV obeys a controller",
            where=record.name,
            fix="exchange the columns, as with --op V1=COLUMN --pv PV1=COLUMN",
        )


def _swapped(sp: FloatArray, op: FloatArray, pv: FloatArray) -> bool:
    """Return whether OP alone tracks SP, or PV obeys a PI law of SP − OP exactly, and OP none."""
    there = np.isfinite(sp) & np.isfinite(op) & np.isfinite(pv)
    sp, op, pv = sp[there], op[there], pv[there]
    if len(op) < FEWEST or not np.ptp(op) > 0.0:
        return False
    right, wrong = explained(op, (sp - pv)[:, None]), explained(pv, (sp - op)[:, None])
    return is_nearer(sp, op, pv) or 1.0 - wrong < EXACT <= 1.0 - right
