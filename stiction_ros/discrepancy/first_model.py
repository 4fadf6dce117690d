"""A first linear model for loops that have none."""

from __future__ import annotations

from collections.abc import Sequence

from stiction_ros.errors import InputError
from stiction_ros.identification.linear_data import LinearKind
from stiction_ros.identification.linear_fit import LinearOptions, fit_linear
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record


def first_model(records: Sequence[Record], delay: tuple[int, int] = (0, 10)) -> LoopModel:
    """Return ARX equations fitted to the longest record, with ideal valves.

    Args:
        records: one at least.
        delay: inclusive range of the delays tried, samples.

    Raises:
        InputError: no record, or no stable model of it.
    """
    if not records:
        raise InputError("no record", where="fit-linear")
    longest = max(records, key=len)
    found = fit_linear(longest, LinearOptions(kind=LinearKind.ARX, delay=delay))
    return found.loop_model(longest.name.removesuffix(".csv") or "loop")
