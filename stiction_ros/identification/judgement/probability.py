r"""The probability of friction, and the verdict as two cuts through it.

The log odds are a sum of small decision trees over the figures (gradient boosting; each figure
whose meaning has a sign acts in that direction alone):

.. math:: \log \frac{P}{1 - P} = c_0 + \sum_t f_t(x)

The trees stand in ``friction_probability.json``. ``stiction calibrate`` of stiction-studies fits
them to simulated loops whose valves are known.
"""

import functools
import json
import math
from importlib.resources import files
from typing import NamedTuple

from stiction_ros.identification.judgement.figures import Figures
from stiction_ros.identification.judgement.verdict_kind import VerdictKind

FILE = "friction_probability.json"
SURE = 0.95
"""Probability from which on a verdict is given: at the cut one of twenty is wrong."""


class Node(NamedTuple):
    """One node of a tree."""

    value: float  # mean log odds of the loops that come here
    figure: str = ""  # that is asked for; empty at a leaf
    at: float = 0.0  # loops with at most this go to ``low``, the others to ``high``
    low: int = 0  # low, high: places of the next nodes in the tree
    high: int = 0


class Model(NamedTuple):
    """Log odds of all loops, and the trees."""

    constant: float
    trees: tuple[tuple[Node, ...], ...]


@functools.cache
def fitted_model() -> Model:
    """Return what was fitted."""
    text = files(__package__).joinpath(FILE).read_text("utf-8")
    told = json.loads(text)
    return Model(told["constant"], tuple(tuple(Node(*n) for n in tree) for tree in told["trees"]))


def contributions(figures: Figures, model: Model | None = None) -> dict[str, float]:
    """Return what each figure adds to the log odds, by name; they sum up to them, less c_0."""
    values = figures.to_dict()
    added = dict.fromkeys(values, 0.0)
    for tree in (model or fitted_model()).trees:
        node = tree[0]
        while node.figure:
            following = tree[node.low if values[node.figure] <= node.at else node.high]
            added[node.figure] += following.value - node.value
            node = following
    return added


def friction_probability(figures: Figures, model: Model | None = None) -> float:
    """Return the probability that a valve has friction that matters, 0 to 1."""
    model = model or fitted_model()
    start = model.constant + sum(tree[0].value for tree in model.trees)
    return 1.0 / (1.0 + math.exp(-start - sum(contributions(figures, model).values())))


def verdict_of(probability: float, figures: Figures, deadband: bool) -> VerdictKind:
    """Return the verdict by a probability.

    Args:
        probability: of friction.
        figures: a valve is healthy only where the record also rules out friction that would
            matter: an ideal valve must be 1 / (1 − :data:`SURE`) times as likely at each rate.
        deadband: whether the friction has no jump.
    """
    if probability >= SURE:
        return VerdictKind.BACKLASH if deadband else VerdictKind.STICKY
    if probability <= 1.0 - SURE and figures.ruled_out >= -math.log(1.0 - SURE):
        return VerdictKind.HEALTHY
    return VerdictKind.UNDECIDED
