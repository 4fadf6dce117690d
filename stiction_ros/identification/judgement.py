r"""The figures of a valve, the probability of friction, and the verdict as two cuts through it.

The log odds are a sum of small decision trees over the figures (gradient boosting; each figure
whose meaning has a sign acts in that direction alone):

.. math:: \log \frac{P}{1 - P} = c_0 + \sum_t f_t(x)

The trees stand in ``friction_probability.json``. ``stiction calibrate`` of stiction-studies fits
them to simulated loops whose valves are known.
"""

import dataclasses
import enum
import functools
import json
import math
from collections.abc import Mapping
from importlib.resources import files
from typing import Any, NamedTuple

FILE = "friction_probability.json"
SURE = 0.95
"""Probability from which on a verdict is given: at the cut one of twenty is wrong."""


class VerdictKind(enum.StrEnum):
    """What the record says about one valve.

    Examples:
        >>> from stiction_ros import VerdictKind
        >>> VerdictKind("sticky") is VerdictKind.STICKY
        True
        >>> [kind.value for kind in VerdictKind if kind.has_friction]
        ['sticky', 'backlash']
    """

    STICKY = "sticky"
    BACKLASH = "backlash"
    HEALTHY = "healthy"
    UNDECIDED = "undecided"

    @property
    def has_friction(self) -> bool:
        """Whether friction is shown: with a jump (sticky), or without one (backlash)."""
        return self in (VerdictKind.STICKY, VerdictKind.BACKLASH)


def _figure(unit: str, definition: str, against: str, sign: int = 0) -> Any:
    """Return a field; ``against`` completes "likely but not sure:", ``sign`` is of its effect."""
    told = {"unit": unit, "definition": definition, "against": against, "sign": sign}
    return dataclasses.field(metadata=told)


@dataclasses.dataclass(frozen=True)
class Figures:
    """What the probability of friction in one valve is computed from.

    Nats are differences of log likelihood between two explanations of the same rows. An ideal
    valve stands alone or beside a wave from outside, whichever explains more. Simulated
    loops are those of the recovered controller with the identified process.
    """

    gain: float = _figure(
        "nats",
        "log likelihood of friction minus that of an ideal valve, minus a price for f_S and f_D; "
        "the lesser at two rates of sampling that find the same size",
        "two rates of sampling do not both show it",
        1,
    )
    ruled_out: float = _figure(
        "nats",
        "log likelihood of an ideal valve minus that of the best friction large enough to matter, "
        "at the rate of sampling that speaks most for friction",
        "an ideal valve explains PV as well at every rate of sampling",
        -1,
    )
    repeats: float = _figure(
        "ratio",
        "how strongly the part of PV that an ideal valve does not explain returns one cycle "
        "later, divided by the gain of friction",
        "PV also repeats itself one cycle later, as beside another loop that cycles",
        -1,
    )
    loop_gone: float = _figure(
        "share",
        "part of the simulated loop's movement that goes away without the friction",
        "the simulated loop moves nearly as much without it",
        1,
    )
    stem_rest: float = _figure(
        "count",
        "rows from one reversal of the estimated stem to the next, in the mean",
        "the estimated stem turns too seldom, or in nearly every row",
    )
    controller_fit: float = _figure(
        "R²", "fit of the recovered controller to OP's moves", "the controller is hardly known"
    )
    band_width: float = _figure(
        "share",
        "width of the interval of f_S + f_D, divided by its upper end",
        "its size is hardly known",
    )
    op_unevenness: float = _figure(
        "ratio",
        "standard deviation of the lengths of OP's half cycles, divided by their mean",
        "OP keeps time as under a wave from outside, or no time at all",
    )
    op_kurtosis: float = _figure(
        "ratio",
        "mean fourth power of OP about its mean over its squared variance: square wave 1, "
        "sine 1.5, triangle 1.8, noise 3",
        "OP has another shape than friction gives it",
    )

    def to_dict(self) -> dict[str, float]:
        return dataclasses.asdict(self)


def definitions() -> Mapping[str, Mapping[str, Any]]:
    """Return ``unit``, ``definition``, ``against`` and ``sign`` of each figure by its name."""
    return {field.name: field.metadata for field in dataclasses.fields(Figures)}


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


def verdict_of(probability: float, responds: bool, deadband: bool) -> VerdictKind:
    """Return the verdict by a probability.

    Args:
        probability: of friction that is large enough to matter.
        responds: whether PV answers the valve; a stem that may be stuck is not healthy.
        deadband: whether the friction has no jump.
    """
    if probability >= SURE:
        return VerdictKind.BACKLASH if deadband else VerdictKind.STICKY
    healthy = probability <= 1.0 - SURE and responds
    return VerdictKind.HEALTHY if healthy else VerdictKind.UNDECIDED
