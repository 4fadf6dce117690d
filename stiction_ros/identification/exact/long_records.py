"""Long records: the search runs over their liveliest part, the conclusion over all of it.

A scan costs grid points times samples. A friction that suits one part of a few thousand samples
is within a few thousandths of the best for the whole, so only its neighbourhood is left to be
looked at with all samples; the cost grows with the length, not with its square.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.identification.exact.polish import look_round
from stiction_ros.identification.problem.models import Data, Model, refit, stem_of
from stiction_ros.identification.problem.output_error import Orders


def carried_over(data: Data, linear: Model, found: Model, orders: Orders) -> Model:
    """Return the best model of the whole record near the friction found in a part of it.

    Args:
        linear: the whole record's model without friction.
        found: the part's model; its friction and delays are taken.
    """
    stems = linear.stems.copy()
    for j in np.flatnonzero(found.friction[:, 0]).tolist():
        stems[j] = stem_of(data, j, found.friction[j], 0.0)
    model = dataclasses.replace(
        linear,
        friction=found.friction,
        start=np.zeros(len(stems)),
        stems=stems,
        delays=found.delays,
    )
    model = refit(data, model, orders, warm=False)
    return min(linear, look_round(data, model, orders), key=lambda candidate: candidate.loss)
