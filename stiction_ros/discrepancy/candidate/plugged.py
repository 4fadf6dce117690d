"""Candidates of behaviours that say themselves on which axes they are searched."""

import dataclasses
from typing import Self

import numpy as np

from stiction_ros.discrepancy.candidate.base import Candidate, KindCandidate, Response
from stiction_ros.discrepancy.candidate.output import OutputCandidate
from stiction_ros.discrepancy.candidate.valve import ValveCandidate
from stiction_ros.discrepancy.candidate.wave import surprises
from stiction_ros.discrepancy.simulation.free_run import FreeRun, seen_of
from stiction_ros.discrepancy.simulation.responses import end_to_end
from stiction_ros.effects import Axis, Behaviour, FloatArray, Seen, behaviours
from stiction_ros.effects.behaviour import BoolArray
from stiction_ros.errors import InputError

ON_OUTPUTS = ("process", "disturbance", "sensor")
NO_FACTORS = np.zeros(0)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Plugged(KindCandidate):
    """A behaviour by its own axes, wherever it acts."""

    @property
    def about(self) -> type[Behaviour]:
        return self.kind

    def possible(self, points: FloatArray) -> BoolArray:
        """Return which points the behaviour takes: of the box of the axes it may refuse a part."""
        found = np.ones(len(points), dtype=bool)
        for g, point in enumerate(points):
            try:
                self.behaviour(point, NO_FACTORS)
            except InputError:
                found[g] = False
        return found


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class PluggedValve(_Plugged, ValveCandidate):
    """A behaviour at the end of a valve's chain."""

    @classmethod
    def of(cls, run: FreeRun, valve: int, kind: type[Behaviour]) -> Self:
        """Return the candidate of a behaviour at a valve by its index."""
        return cls.at(run, valve, kind, axes_of(kind, seen_of(run, run.stems[:, valve])))


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

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        wave = simulated(run, self.kind, points, np.zeros(len(run.runs)))
        entering = run.stems[:, self.valve, None] + wave
        reached = [i for i in range(run.forced.shape[1]) if run.responses.reaches(i, self.valve)]
        shifts = {i: run.drive(i, self.valve, entering) - run.forced[:, i : i + 1] for i in reached}
        return Response(shifts or {0: np.zeros(wave.shape)})


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

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        incoming = self.signal(run)
        values = simulated(run, self.kind, points, incoming)
        return Response({self.output: values - incoming[:, None]})


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


def is_dated(kind: type[Behaviour]) -> bool:
    """Tell whether the first figure of a behaviour is a moment of the record."""
    return kind.parameters()[0].key == "time"


def simulated(
    run: FreeRun, kind: type[Behaviour], points: FloatArray, values: FloatArray
) -> FloatArray:
    """Return what a behaviour makes of a signal, shape (N, G), record by record."""
    step, slices = run.runs.sample_time, run.runs.slices
    parts = [kind.simulate_grid(points, values[r], float(values[r.start]), step) for r in slices]
    return end_to_end(parts)
