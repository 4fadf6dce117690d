"""Long records: the search runs over their liveliest part, the conclusion over all of it.

A scan costs grid points times samples. A friction that suits one part of a few thousand samples
is within a few thousandths of the best for the whole, so only its neighbourhood is left to be
looked at with all samples; the cost grows with the length, not with its square.
"""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.exact.neighbourhood import REJECTED, refine
from stiction_ros.identification.exact.search import comb
from stiction_ros.identification.problem.models import Data, Model, refit, stem_of
from stiction_ros.identification.problem.output_error import Orders

PART = 6000


def liveliest_part(data: Data) -> Data:
    """Return the ``PART`` samples in which OP moves most; all of a shorter record."""
    samples = data.u.shape[1]
    if samples <= PART:
        return data
    begin = liveliest_begin(data.u / data.u.std(axis=1, keepdims=True))
    return data.part(begin, begin + PART)


def liveliest_begin(op: FloatArray) -> int:
    """Return where the ``PART`` samples begin in which OP, scaled, shape (m, N), moves most."""
    samples = op.shape[1]
    begins = np.linspace(0, samples - PART, 2 * (samples // PART) + 1).astype(int)
    moved = [float(op[:, at : at + PART].std(axis=1).sum()) for at in begins]
    return int(begins[int(np.argmax(moved))])


def carried_over(data: Data, linear: Model, found: Model, orders: Orders) -> Model:
    """Return the best model of the whole record near the friction found in a part of it.

    Args:
        linear: the whole record's model without friction.
        found: the part's model; its friction and delays are taken.
    """
    stems = linear.stems.copy()
    sticky = [int(j) for j in np.flatnonzero(found.friction[:, 0])]
    for j in sticky:
        stems[j] = stem_of(data, j, found.friction[j], 0.0)
    model = dataclasses.replace(
        linear,
        friction=found.friction,
        start=np.zeros(len(stems)),
        stems=stems,
        delays=found.delays,
    )
    model = refit(data, model, orders, warm=False)
    for j in sticky:
        model = comb(data, model, orders, j)
        model, _ = refine(data, model, orders, j, REJECTED)
    return min(linear, model, key=lambda candidate: candidate.loss)
