"""One row of a benchmark."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray


@dataclasses.dataclass(frozen=True)
class Row:
    """One comparison; times are medians in ms, ``ratio`` = baseline / subject."""

    case: str
    subject: str
    baseline: str
    subject_ms: float
    baseline_ms: float
    p99_ms: float
    ratio: float
    note: str


def row(
    case: str,
    names: tuple[str, str],
    subject: Sequence[float] | FloatArray,
    baseline: Sequence[float] | FloatArray,
    note: str,
) -> Row:
    """Return a row.

    Args:
        case: what both worked on.
        names: of subject and baseline.
        subject, baseline: their times, ms, one or more each.
        note: what the figures do not say.
    """
    middle, base = float(np.median(subject)), float(np.median(baseline))
    last = float(np.percentile(subject, 99))
    return Row(case, *names, middle, base, last, base / middle, note)
