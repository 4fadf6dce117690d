r"""The probability of an effect by the evidence that it is ahead, in equal shares within a set.

.. math:: \log \frac{P}{1 - P} = a + b \log(1 + e)

:math:`e` is the evidence by which the best of a set beats no effect and all rivals outside the set.
The figures stand in ``gap_probability.json``. ``stiction calibrate --gap`` of stiction-studies fits
them to simulated loops whose effects are known.
"""

import functools
import json
import math
from collections.abc import Sequence
from importlib.resources import files
from typing import Any, NamedTuple

from stiction_ros.discrepancy.decision.explanation import AddedEffect

FILE = "gap_probability.json"
Name = tuple[str, str]  # place and effect


class Coefficients(NamedTuple):
    """What was fitted."""

    constant: float  # log odds of what is not ahead at all
    slope: float  # of the log odds, by the logarithm of the evidence


class Standing(NamedTuple):
    """What speaks for a set of effects, of which one acts; mostly it has one member."""

    ahead: float  # evidence, in BIC, over no effect and all rivals
    names: Sequence[Any]  # of the set

    def probabilities(self, by: Coefficients | None = None) -> dict[Any, float]:
        """Return the probability of each member, that of the set in sum."""
        constant, slope = by or shipped()
        odds = constant + slope * math.log1p(max(self.ahead, 0.0))
        return dict.fromkeys(self.names, 1.0 / (1.0 + math.exp(-odds)) / len(self.names))


@functools.cache
def shipped() -> Coefficients:
    """Return what was fitted."""
    told = json.loads(files(__package__).joinpath(FILE).read_text("utf-8"))
    return Coefficients(*(told[key] for key in Coefficients._fields))


def standing(effect: AddedEffect, known: Sequence[AddedEffect]) -> Standing:
    """Return how far an effect, or one of those not told from it, is ahead of all rivals.

    Neither what is in the model besides nor what contains one of the set is a rival.
    """
    own = effect.fit
    names = dict.fromkeys((own.candidate.key, *effect.alternatives))
    apart = names.keys() | {each.fit.candidate.key for each in known}
    best, rivals = own.evidence, [0.0]
    for fit in effect.fits:
        if not names.keys().isdisjoint(fit.candidate.keys):
            best = max(best, fit.evidence)
        if apart.isdisjoint((*fit.candidate.keys, *fit.candidate.contains)):
            rivals.append(fit.evidence)
    return Standing(best - max(rivals), tuple(names))
