"""The score that chance alone brings about, as calibrated once: the threshold of ``--quick``."""

from __future__ import annotations

import math

# Candidates, and the evidence that 95 % of records of noise alone stay below:
# ``stiction bench gap --calibrate --first 0 --loops 48``, 8 records from each tuning loop.
FEW, SCORE_OF_FEW = 13, 2.1  # one valve, one output
MANY, SCORE_OF_MANY = 26, 4.4  # two valves, two outputs


def stored_threshold(candidates: int) -> float:
    """Return the evidence, in BIC, that chance brings about in one record of twenty.

    The largest of many scores of chance grows with the logarithm of their number.

    Args:
        candidates: of the catalogue that are tried, ≥ 1.
    """
    growth = (SCORE_OF_MANY - SCORE_OF_FEW) / math.log(MANY / FEW)
    return SCORE_OF_FEW + growth * math.log(max(candidates, 1) / FEW)
