"""What samples do not show of the OP that a valve feels, and what that leaves open of its friction.

A law is judged on OP as it was sampled, and two things are in no sample. The stem feels what OP
does between them, too, and slips at peaks there: OP turned farther than the record shows. And it
may answer up to a sample later than OP moves: what OP has moved on by then is no friction.

The band f_S + f_D is what OP passes from one slip to the next in the other direction, the jump
f_S − f_D what it passes to the next in the same direction. Either has two such ends. A jump is not
smaller than the samples show for answering late: of a slip that they give no reason for, a smaller
jump makes the best already.
"""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.evidence.accepted import Interval
from stiction_ros.identification.evidence.fit_problem import NOISE_ORDER
from stiction_ros.signals.autoregression import innovations, noise_of

BETWEEN = 2.0  # standard deviations of OP's innovations by which an end may lie farther out
LATE = 1.0  # samples by which a stem answers late, at most


@dataclasses.dataclass(frozen=True)
class Unseen:
    """By how much one end may lie elsewhere than the samples show; unit of OP, 0 or more."""

    less: float  # what OP moves before the stem answers
    more: float  # by how much OP goes farther between samples

    @classmethod
    def of(cls, op: FloatArray) -> "Unseen":
        """Return what samples of OP leave open, shape (N,), N at least 20."""
        return cls(LATE * float(np.abs(np.diff(op)).mean()), BETWEEN * innovation(op))

    def band(self, held: Interval) -> Interval:
        """Return the f_S + f_D that are possible where the samples accept ``held``."""
        return max(held[0] - 2.0 * self.less, 0.0), held[1] + 2.0 * self.more

    def static(self, held: Interval) -> Interval:
        """Return the f_S, half of band and jump, that are possible."""
        return max(held[0] - self.less, 0.0), held[1] + 2.0 * self.more

    def dynamic(self, held: Interval) -> Interval:
        """Return the f_D, half of what the band has more than the jump, that are possible."""
        return max(held[0] - self.less - self.more, 0.0), held[1] + self.more


def innovation(op: FloatArray) -> float:
    """Return the standard deviation of what the past of OP does not tell."""
    op = op - op.mean()
    return float(innovations(noise_of(op, NOISE_ORDER), op)[NOISE_ORDER:].std())
