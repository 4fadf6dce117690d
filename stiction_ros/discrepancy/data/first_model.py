"""A first linear model for loops that have none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.data.long_records import liveliest_parts
from stiction_ros.errors import InputError
from stiction_ros.identification.linear.data import LinearKind
from stiction_ros.identification.linear.fit import LinearOptions, fit_linear
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record


def first_model(records: Sequence[Record], delay: tuple[int, int] = (0, 10)) -> LoopModel:
    """Return ARX equations fitted to the longest record, with ideal valves.

    Without set-points the record is that of a loop at rest but for its own noise or cycle: of
    many coefficients the model could make the controller turned upside down, so it has two a
    and two b. The workflow fits them again and compares them with more poles.

    Args:
        records: one at least.
        delay: inclusive range of the delays tried, samples.

    Raises:
        InputError: no record, or no stable model of it.
    """
    if not records:
        raise InputError("no record", where="fit-linear")
    longest = max(liveliest_parts(records), key=len)
    options = LinearOptions(kind=LinearKind.ARX, delay=delay)
    if not _moved(longest):
        options = LinearOptions(LinearKind.ARX, output_order=2, input_order=2, delay=delay)
    found = fit_linear(longest, options)
    return found.loop_model(longest.name.removesuffix(".csv") or "loop")


def _moved(record: Record) -> bool:
    return record.sp is not None and bool(np.any(np.ptp(record.sp, axis=0) > 0.0))
