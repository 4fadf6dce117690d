"""What a search for an effect is told of the signal, and what it says is to be searched."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ON_BOUND = 1e-3  # of the range of a search, from its ends


@dataclasses.dataclass(frozen=True)
class Seen:
    """The signal that an effect would act on, as the records show it."""

    values: FloatArray  # of all records, shape (N,)
    fastest: float  # its largest move per second
    sample_time: float  # s

    @property
    def duration(self) -> float:
        """Length of all records together, s."""
        return len(self.values) * self.sample_time

    @property
    def span(self) -> float:
        """Width of all but the most extreme .4 % of the values."""
        return float(np.quantile(self.values, 0.998) - np.quantile(self.values, 0.002))


@dataclasses.dataclass(frozen=True)
class Axis:
    """One figure that is searched: ``points`` between two ends, both included.

    The axes of an effect span a box. What the effect itself refuses of it with
    :class:`~stiction_ros.errors.InputError`, such as f_D > f_S, is left out of the search; an
    effect that refuses all of it is not considered.

    Where the best figures are a needle in a valley, as those of a law that slips, a lattice may
    miss them: give more ``points``, or axes along and across the valley.
    """

    low: float  # low, high: ends
    high: float
    points: int  # of the first grid
    logarithmic: bool = False  # whether the points are in proportion
    # whether the response is a straight line in it, so that its best value is the vertex of a
    # parabola
    linear: bool = False
    natural: bool = False  # whether its ends are values like all others, no bounds of the search
    # whether it is where something stood at first: no figure of the effect, none that counts
    start: bool = False

    def grid(self) -> FloatArray:
        """Return the first grid, in coordinates of the search."""
        low, high = self.inner(self.low), self.inner(self.high)
        middle = [0.5 * (low + high)]
        return np.linspace(low, high, self.points) if self.points > 1 else np.array(middle)

    def inner(self, value: float) -> float:
        """Return the coordinate of the search that belongs to a value."""
        return float(np.log(value)) if self.logarithmic else value

    def outer(self, coordinates: FloatArray) -> FloatArray:
        """Return the values that belong to coordinates, kept within the ends."""
        values = np.exp(coordinates) if self.logarithmic else coordinates
        return np.minimum(np.maximum(values, self.low), self.high)

    def bounds(self, value: float) -> bool:
        """Tell whether a value lies on the bound of the search, so that a better one may not."""
        if self.natural or self.linear or self.points < 2:
            return False
        low, high = self.inner(self.low), self.inner(self.high)
        near = ON_BOUND * (high - low)
        at = self.inner(value)
        return not low + near <= at <= high - near

    @property
    def spacing(self) -> float:
        """Distance of two points of the first grid, in coordinates of the search."""
        if self.points < 2:
            return 0.5 * (self.inner(self.high) - self.inner(self.low))
        return (self.inner(self.high) - self.inner(self.low)) / (self.points - 1)
