r"""The probability of an effect by the evidence that it is ahead, and the shares of a set in doubt.

.. math:: \log \frac{P}{1 - P} = a + b \log(1 + e), \qquad P_i \propto \exp\frac{e_i}{2 T}

:math:`e` is the evidence by which the best of a set beats no effect and all rivals outside the set,
:math:`e_i` that of one of the set. The figures stand in ``gap_probability.json``. ``stiction
calibrate --gap`` of stiction-studies fits them to simulated loops whose effects are known.
"""

import functools
import json
import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, NamedTuple

from stiction_ros.discrepancy.decision.explanation import AddedEffect

FILE = "gap_probability.json"
Name = tuple[str, str]  # place and effect


class Coefficients(NamedTuple):
    """What was fitted."""

    constant: float  # log odds of what is not ahead at all
    slope: float  # of the log odds, by the logarithm of the evidence
    temperature: float  # by which the evidence within a set counts less


class Standing(NamedTuple):
    """What speaks for a set of effects, of which one acts; mostly it has one member."""

    ahead: float  # evidence, in BIC, over no effect and all rivals
    evidences: Mapping[Any, float]  # of each member

    def probabilities(self, by: Coefficients | None = None) -> dict[Any, float]:
        """Return the probability of each member, that of the set in sum."""
        constant, slope, temperature = by or shipped()
        odds = constant + slope * math.log1p(max(self.ahead, 0.0))
        best = max(self.evidences.values())
        own = {k: math.exp((e - best) / (2.0 * temperature)) for k, e in self.evidences.items()}
        both = sum(own.values()) * (1.0 + math.exp(-odds))
        return {name: weight / both for name, weight in own.items()}


@functools.cache
def shipped() -> Coefficients:
    """Return what was fitted."""
    told = json.loads(files(__package__).joinpath(FILE).read_text("utf-8"))
    return Coefficients(*(told[key] for key in Coefficients._fields))


def standing(effect: AddedEffect, known: Sequence[AddedEffect]) -> Standing:
    """Return how far an effect, or one of those not told from it, is ahead of all rivals.

    Neither what is in the model besides nor what contains one of the set is a rival. A member that
    was not fitted has the evidence of the effect.
    """
    own = effect.fit
    given = dict.fromkeys((own.candidate.key, *effect.alternatives), -math.inf)
    apart = given.keys() | {each.fit.candidate.key for each in known}
    rivals = [0.0]
    for fit in effect.fits:
        for name in given.keys() & fit.candidate.keys:
            given[name] = max(given[name], fit.evidence)
        if apart.isdisjoint((*fit.candidate.keys, *fit.candidate.contains)):
            rivals.append(fit.evidence)
    given = {name: e if math.isfinite(e) else own.evidence for name, e in given.items()}
    return Standing(max(given.values()) - max(rivals), given)
