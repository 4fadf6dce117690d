"""Candidates of behaviours that say themselves on which axes they are searched."""

import dataclasses
from typing import Self

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate, Response
from stiction_ros.discrepancy.candidate.output import OutputCandidate
from stiction_ros.discrepancy.candidate.valve import ValveCandidate
from stiction_ros.discrepancy.candidate.wave import surprises
from stiction_ros.discrepancy.simulation.free_run import FreeRun, end_to_end, seen_of
from stiction_ros.effects import Axis, Behaviour, FloatArray, Seen, behaviours
from stiction_ros.effects.behaviour import BoolArray
from stiction_ros.errors import InputError

ON_OUTPUTS = ("process", "disturbance", "sensor")


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Plugged(Candidate):
    """A behaviour by its own axes, wherever it acts."""

    kind: type[Behaviour]  # the behaviour
    # at which PV surprises most, s; first values of a figure that is a moment
    moments: FloatArray = dataclasses.field(default_factory=lambda: np.zeros(0))

    def grid(self) -> FloatArray:
        return with_moments(super().grid(), self.axes, self.moments if self.dated else None)

    @property
    def about(self) -> type[Behaviour]:
        return self.kind

    @property
    def law(self) -> str | None:
        return self.kind.law

    def possible(self, points: FloatArray) -> BoolArray:
        return possible(self.kind, points)

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour:
        return made(self.kind, point)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class PluggedValve(_Plugged, ValveCandidate):
    """A behaviour at the end of a valve's chain."""

    @classmethod
    def of(cls, run: FreeRun, valve: int, kind: type[Behaviour]) -> Self:
        """Return the candidate of a behaviour at a valve by its index."""
        return cls.at(run, valve, kind, axes_of(kind, seen_of(run, run.stems[:, valve])))

    def stems(self, run: FreeRun, points: FloatArray, *, from_measured: bool = False) -> FloatArray:
        """Return stem positions, shape (N, G), %; OP where the figures are not possible."""
        rows = self.possible(points)
        if rows.all():
            return super().stems(run, points, from_measured=from_measured)
        stems = np.repeat(run.stems[:, self.valve, None], len(points), axis=1)
        if rows.any():
            stems[:, rows] = super().stems(run, points[rows], from_measured=from_measured)
        return stems

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        return dataclasses.replace(super().respond(run, points), possible=self.possible(points))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class PluggedLoad(_Plugged):
    """A behaviour that enters the process beside the stem of a valve."""

    valve: int  # its index

    @classmethod
    def of(cls, run: FreeRun, valve: int, kind: type[Behaviour], moments: FloatArray) -> Self:
        """Return the candidate of a behaviour at a valve by its index."""
        return cls(
            place=f"load:{run.model.valves[valve].name}",
            effect=kind.effect,
            axes=axes_of(kind, seen_of(run, np.zeros(len(run.runs)))),
            dated=is_dated(kind),
            valve=valve,
            kind=kind,
            moments=moments,
        )

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        wave = simulated(run, self.kind, points, np.zeros(len(run.runs)))
        entering = run.stems[:, self.valve, None] + wave
        reached = [i for i in range(run.forced.shape[1]) if run.responses.reaches(i, self.valve)]
        shifts = {i: run.drive(i, self.valve, entering) - run.forced[:, i : i + 1] for i in reached}
        return Response(shifts or {0: np.zeros(wave.shape)}, possible=self.possible(points))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class PluggedOutput(_Plugged, OutputCandidate):
    """A behaviour in the process, on an output or at its sensor."""

    @classmethod
    def of(
        cls, run: FreeRun, output: int, place: str, kind: type[Behaviour], moments: FloatArray
    ) -> Self:
        """Return the candidate of a behaviour at a kind of place of an output by its index."""
        bare = cls(
            place=f"{place}:{run.model.outputs[output]}",
            effect=kind.effect,
            dated=is_dated(kind),
            output=output,
            kind=kind,
            moments=moments,
        )
        return dataclasses.replace(bare, axes=axes_of(kind, seen_of(run, bare.signal(run))))

    def signal(self, run: FreeRun) -> FloatArray:
        """Return what it acts on: nothing, the output of the process, or what a sensor sees."""
        if self.place.startswith("disturbance:"):
            return np.zeros(len(run.runs))
        values = run.forced[:, self.output]
        return values if self.place.startswith("process:") else values + run.known[:, self.output]

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        incoming = self.signal(run)
        return Response(
            {self.output: simulated(run, self.kind, points, incoming) - incoming[:, None]},
            possible=self.possible(points),
        )


def plugged_candidates(run: FreeRun, whitened: list[FloatArray]) -> list[Candidate]:
    """Return a candidate for every place of every behaviour that names axes.

    Args:
        run: of the current model.
        whitened: per output the innovations, shape (N,).
    """
    found: list[Candidate] = []
    everywhere = surprises(run, whitened)
    for kind in behaviours():
        if kind.axes.__func__ is Behaviour.axes.__func__:  # type: ignore[attr-defined]
            continue
        for j in range(len(run.model.valves)):
            if "valve" in kind.places:
                found.append(PluggedValve.of(run, j, kind))
            if "load" in kind.places:
                found.append(PluggedLoad.of(run, j, kind, everywhere))
        for i in range(len(run.model.outputs)):
            places = [place for place in ON_OUTPUTS if place in kind.places]
            moments = surprises(run, [whitened[i]])
            found += [PluggedOutput.of(run, i, place, kind, moments) for place in places]
    return [c for c in found if c.axes and c.possible(c.values(c.grid())).any()]


def possible(kind: type[Behaviour], points: FloatArray) -> BoolArray:
    """Return which rows of figures a behaviour takes, shape (G,).

    Axes span a box; a law may refuse a part of it, as f_D > f_S.
    """
    found = np.ones(len(points), dtype=bool)
    for g, point in enumerate(points):
        try:
            made(kind, point)
        except InputError:
            found[g] = False
    return found


def axes_of(kind: type[Behaviour], seen: Seen) -> tuple[Axis, ...]:
    """Return the axes of a behaviour.

    Raises:
        InputError: not one for each of its parameters.
    """
    axes = kind.axes(seen)
    if axes and len(axes) != len(kind.parameters()):
        raise InputError(
            f"{len(axes)} axes for {len(kind.parameters())} parameters",
            where=f"{kind.__module__}.{kind.__name__}.axes",
            fix="return one axis for each parameter, in their order, or none at all",
        )
    return axes


def with_moments(
    grid: FloatArray, axes: tuple[Axis, ...], moments: FloatArray | None
) -> FloatArray:
    """Return a grid, shape (G, axes), with further values of its first axis, a moment in s."""
    if moments is None or not len(moments):
        return grid
    first = np.clip(moments, axes[0].low, axes[0].high)
    others = np.unique(grid[:, 1:], axis=0)
    more = np.column_stack([np.repeat(first, len(others)), np.tile(others, (len(first), 1))])
    return np.unique(np.vstack([grid, more]), axis=0)


def is_dated(kind: type[Behaviour]) -> bool:
    """Tell whether the first figure of a behaviour is a moment of the record."""
    return kind.parameters()[0].key == "time"


def simulated(
    run: FreeRun, kind: type[Behaviour], points: FloatArray, values: FloatArray
) -> FloatArray:
    """Return what a behaviour makes of a signal, shape (N, G), record by record.

    The signal as it is where the figures are not possible.
    """
    step, taken = run.runs.sample_time, possible(kind, points)
    out = np.repeat(values[:, None], len(points), axis=1)
    if taken.any():
        parts = [
            kind.simulate_grid(points[taken], values[rows], float(values[rows.start]), step)
            for rows in run.runs.slices
        ]
        out[:, taken] = end_to_end(parts)
    return out


def made(kind: type[Behaviour], point: FloatArray) -> Behaviour:
    """Return the behaviour with the figures of a point."""
    keys = [entry.key for entry in kind.parameters()]
    return kind.from_mapping(dict(zip(keys, point.tolist(), strict=True)))
