"""What a candidate is: one change of the current model, with figures to be searched."""

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np

from stiction_ros.discrepancy.measures import ROUNDING
from stiction_ros.discrepancy.simulation.between import beyond_samples
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Axis, Behaviour, FloatArray, Seen, about
from stiction_ros.effects.behaviour import BoolArray
from stiction_ros.signals.autoregression import TINY


@dataclasses.dataclass(frozen=True)
class Response:
    """What a candidate adds to the free run, for G points of its grid."""

    shifts: Mapping[int, FloatArray]  # per output, shape (N, G): added as it is
    # per output, shape (N, G, s): added with s factors that least squares finds
    sizes: Mapping[int, FloatArray] = dataclasses.field(default_factory=dict)
    # which points are figures that the effect can have, shape (G,); None for all
    possible: BoolArray | None = None

    @property
    def outputs(self) -> tuple[int, ...]:
        """Indices of the outputs that it touches."""
        return tuple(sorted({*self.shifts, *self.sizes}))

    def moves(self, output: int, factors: FloatArray) -> FloatArray:
        """Return what is added to an output that it touches, with these factors, shape (N, G)."""
        if output in self.shifts:
            return self.shifts[output]
        return np.asarray(self.sizes[output] @ factors)

    def towards(self, other: "Response", share: FloatArray) -> "Response":
        """Return what lies a share, shape (G,), of the way to another response, or beyond it."""
        shifts = {
            i: self.shifts.get(i, 0.0)
            + share * (other.shifts.get(i, 0.0) - self.shifts.get(i, 0.0))
            for i in self.shifts.keys() | other.shifts.keys()
        }
        return Response(shifts, possible=self.possible)

    def pick(self, point: int) -> "Response":
        """Return the response at one point of the grid."""
        return Response(
            {i: v[:, point : point + 1] for i, v in self.shifts.items()},
            {i: v[:, point : point + 1] for i, v in self.sizes.items()},
            None if self.possible is None else self.possible[point : point + 1],
        )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Candidate(ABC):
    """One change of the current model; the same one beside another model has its ``name``."""

    place: str  # place, effect: as loop models name them, such as ``valve:V1`` and ``stiction``
    effect: str
    axes: tuple[Axis, ...] = ()  # of the figures that are searched; may be empty
    factors: int = 0  # figures that least squares finds
    # places and effects that look the same in every record of OP and PV
    twins: tuple[tuple[str, str], ...] = ()
    # whether it belongs to the catalogue; others show only that something is amiss
    inside: bool = True
    dated: bool = False  # whether its first axis is a moment of the record
    # at which PV surprises most, s: further values of such an axis in the first grid
    moments: FloatArray = dataclasses.field(default_factory=lambda: np.zeros(0))
    # places and effects of the catalogue that are parts of it
    contains: tuple[tuple[str, str], ...] = ()
    # share of what it gains that such a part has to gain to be looked at first
    most_of: float = 0.5
    needle: bool = False  # whether its optimum is narrower than any lattice is fine
    # whether its likelihood may have peaks a sample wide, so that it is searched under noises as
    # well that blur them
    sharp: bool = False

    @abstractmethod
    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        """Return the response for points of shape (G, axes), values that the effect can have."""

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        """Return the response for points of shape (G, axes), values; others are marked as such."""
        possible = self.possible(points)
        if possible.all():
            return self.answer(run, points)
        if not possible.any():
            return Response({0: np.zeros((len(run.runs), len(points)))}, possible=possible)
        able = np.where(possible[:, None], points, points[np.argmax(possible)])
        return dataclasses.replace(self.answer(run, able), possible=possible)

    @abstractmethod
    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour | None:
        """Return the effect with these figures; None outside the catalogue."""

    def count(self, point: FloatArray) -> int:
        """Return the number of free figures at a point, for BIC."""
        return sum(not axis.start for axis in self.axes) + self.factors

    def grid(self) -> FloatArray:
        """Return the first grid in coordinates of the search, shape (G, axes)."""
        if not self.axes:
            return np.zeros((1, 0))
        values, first = [axis.grid() for axis in self.axes], self.axes[0]
        if self.dated:
            values[0] = np.union1d(values[0], np.clip(self.moments, first.low, first.high))
        meshed = np.meshgrid(*values, indexing="ij")
        return np.stack([each.ravel() for each in meshed], axis=1)

    def values(self, coordinates: FloatArray) -> FloatArray:
        """Return values for coordinates of the search, both of shape (G, axes)."""
        if not self.axes:
            return coordinates
        return np.stack([axis.outer(coordinates[:, d]) for d, axis in enumerate(self.axes)], axis=1)

    def possible(self, points: FloatArray) -> BoolArray:
        """Return which points, values of shape (G, axes), are figures that the effect can have."""
        return np.ones(len(points), dtype=bool)

    def coordinates(self, point: FloatArray) -> FloatArray:
        """Return the coordinates of the search of one point, both of shape (axes,)."""
        return np.array([a.inner(v) for a, v in zip(self.axes, point.tolist(), strict=True)])

    def apart(self, coordinates: FloatArray, loss: FloatArray, most: int) -> list[int]:
        """Return the best points that are no neighbours of each other in the first grid.

        Args:
            coordinates: of the search, shape (G, axes).
            loss: shape (G,), the least is best.
            most: how many at most.
        """
        steps = np.array([max(axis.spacing, TINY) for axis in self.axes])
        chosen: list[int] = []
        for place in np.argsort(loss, kind="stable").tolist():
            away = [np.abs((coordinates[place] - coordinates[k]) / steps) for k in chosen]
            if all(each.max(initial=0.0) > 1.0 + ROUNDING for each in away):
                chosen.append(place)
            if len(chosen) == most:
                break
        return chosen

    def lead(self, points: FloatArray) -> FloatArray:
        """Return how far off its input a stem or lag stands before the first sample, shape (G,)."""
        own = [points[:, d] for d, axis in enumerate(self.axes) if axis.start]
        return own[0] if own else np.zeros(len(points))

    def leaps(self, point: FloatArray) -> bool:
        """Tell whether a stem that leaves its rest jumps by a size that matters."""
        return True

    def large_enough(self, point: FloatArray, factors: FloatArray) -> bool:
        """Tell whether its figures are of engineering size.

        Args:
            point: searched figures, shape (axes,).
            factors: figures found by least squares, shape (s,).
        """
        return abs(float(point[0])) >= self.about.least if len(point) else True

    def reference(self, seen: Seen) -> tuple[float, ...]:
        """Return searched figures of engineering size; those left out are 0, or the nearest end.

        Args:
            seen: the signal that it acts on.
        """
        return self.about.reference(seen)

    def signal(self, run: FreeRun) -> FloatArray:
        """Return the signal that it acts on, shape (N,)."""
        return run.forced[:, 0]

    @property
    def about(self) -> type[Behaviour]:
        """What is known of its effect; nothing of one outside the catalogue."""
        return about(self.effect) if self.inside else Behaviour

    @property
    def absorbed(self) -> bool:
        """Whether another linear process would do as well."""
        return self.about.absorbed

    @property
    def curved(self) -> bool:
        """Whether it bends what OP does to PV by one figure that is searched."""
        return self.about.bends and len(self.axes) == 1 and not self.factors

    @property
    def smooth(self) -> bool:
        """Whether the free run is smooth in its first figure, so that it can be followed."""
        return self.curved

    @property
    def stepped(self) -> bool:
        """Whether its likelihood jumps: at a moment of the record, or where a stem slips."""
        return self.dated or self.needle

    def at_bound(self, point: FloatArray) -> bool:
        """Tell whether a figure lies on the bound of its range: then it is no figure."""
        return any(axis.bounds(v) for axis, v in zip(self.axes, point.tolist(), strict=True))

    def keeps(self, run: FreeRun, point: FloatArray) -> float | None:
        """Return e^(−T_s/τ) where it is a lag that may act on the noise too; None elsewhere."""
        return None

    @property
    def key(self) -> tuple[str, str]:
        """Place and effect."""
        return self.place, self.effect

    @property
    def keys(self) -> tuple[tuple[str, str], ...]:
        """Place and effect, its own first, of all that it stands for."""
        return (self.key, *self.twins)

    def or_else(self, place: str, effect: str) -> Self:
        """Return the same with one more effect that no record of OP and PV tells from it."""
        return dataclasses.replace(self, twins=(*self.twins, (place, effect)))

    @property
    def name(self) -> str:
        """Name for people, such as ``valve:V1 stiction (he)``."""
        return f"{self.place} {self.effect}" + (f" ({self.law})" if self.law else "")

    @property
    def law(self) -> str | None:
        """Law, where its effect has several; None elsewhere."""
        return None


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class KindCandidate(Candidate):
    """A candidate whose figures are those of one behaviour, in their order."""

    kind: type[Behaviour]  # the behaviour

    @property
    def law(self) -> str | None:
        return self.kind.law

    def rows(self, points: FloatArray) -> FloatArray:
        """Return the behaviour's parameters, shape (G, parameters), for points of the grid."""
        return points[:, : len(self.kind.parameters())]

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        keys = [entry.key for entry in self.kind.parameters()]
        row = self.rows(point[None, :])[0].tolist()
        return self.kind.from_mapping(dict(zip(keys, row, strict=False)))


def figures_of(behaviour: Behaviour) -> dict[str, float]:
    """Return the parameters of an effect by key, in engineering units."""
    return {p.key: float(getattr(behaviour, p.attribute)) for p in behaviour.parameters()}


def spans_of(figures: Sequence[Mapping[str, float]]) -> dict[str, tuple[float, float]]:
    """Return between which values each of several sets of parameters lies."""
    return {key: (min(f[key] for f in figures), max(f[key] for f in figures)) for key in figures[0]}


class Lagging(Candidate):
    """A lag by its time constant, where it begins, and how far it goes on between samples."""

    def between(
        self, run: FreeRun, points: FloatArray, output: int, valve: int | None = None
    ) -> FloatArray:
        """Return what goes on between samples, shape (N, G), as far as the points say, if they do.

        Args:
            run, points, output: of the model, shape (G, axes), and its index.
            valve: index of the valve that is slow; None for the process and the sensor.
        """
        if points.shape[1] < 3:
            return np.zeros((len(run.runs), 1))
        if (output, valve) not in run.beyond:
            from scipy.interpolate import CubicSpline  # slow to import

            axis = self.axes[0]
            lags = axis.outer(axis.grid())
            found = beyond_samples(run, output, lags, valve)
            run.beyond[output, valve] = CubicSpline(np.log(lags), found, axis=1)
        share = 0.5 + points[:, 2]
        return np.asarray(share * run.beyond[output, valve](np.log(points[:, 0])))


def lag_axis(run: FreeRun) -> Axis:
    """Return the range of time constants that a record tells, from half a sample on.

    Between samples a signal moves on: less than one of them may be the sampling's own.
    """
    step = run.runs.sample_time
    return Axis(0.5 * step, max(len(run.runs) / 8.0, 2.0) * step, 20, logarithmic=True)


def between_axes(asked: bool) -> tuple[Axis, ...]:
    """Return the axis of how far a lag goes on between samples; none where that is not asked.

    From -½, a lag that acts on the samples alone, as in loop models, to ½, that of a plant.
    """
    return (Axis(-0.5, 0.5, 1, linear=True),) if asked else ()
