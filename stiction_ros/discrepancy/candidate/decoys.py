"""Rivals outside the catalogue: they show that something is amiss which it does not name."""

import dataclasses
from typing import Self

import numpy as np

from stiction_ros.deferred import lfilter
from stiction_ros.discrepancy.candidate.base import Candidate, Response
from stiction_ros.discrepancy.candidate.output import OutputCandidate
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Axis, Behaviour, FloatArray

KNOTS = 6
LAGS = (0.0, 2.0, 6.0, 18.0)  # samples


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Decoy(OutputCandidate):
    inside: bool = False

    def behaviour(self, run: FreeRun, point: FloatArray, factors: FloatArray) -> Behaviour | None:
        return None


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class GainChange(_Decoy):
    """A process whose gain changes at one moment."""

    effect: str = "gain that changes"
    factors: int = 2
    dated: bool = True

    @classmethod
    def of(cls, run: FreeRun, output: int) -> Self:
        """Return the rival of an output by its index."""
        tag, last = run.model.outputs[output], float(run.runs.time.max())
        steps = [(f"load:{valve}", "step") for valve in run.model.valve_names]
        return cls(
            place=f"process:{tag}",
            axes=(Axis(0.1 * last, 0.9 * last, 17),),
            contains=((f"disturbance:{tag}", "step"), *steps),
            output=output,
        )

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        late = (run.runs.time[:, None] >= points[:, 0]).astype(float)
        free = run.forced[:, self.output, None] - run.forced[:, self.output].mean()
        return Response({}, {self.output: np.stack([late * free, late], axis=2)})


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Trend(_Decoy):
    """A slow unknown load: a cubic spline in time."""

    effect: str = "slow load"
    factors: int = KNOTS

    @classmethod
    def of(cls, run: FreeRun, output: int) -> Self:
        """Return the rival of an output by its index."""
        place = f"disturbance:{run.model.outputs[output]}"
        places = (place, *(f"load:{valve}" for valve in run.model.valve_names))
        walks = tuple((each, "random_walk") for each in places)
        return cls(place=place, contains=walks, output=output)

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        from scipy.interpolate import BSpline

        at = run.runs.time / max(float(run.runs.time.max()), 1e-9)
        knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, KNOTS - 1), np.ones(3)])
        basis = BSpline.design_matrix(np.clip(at, 0.0, 1.0 - 1e-12), knots, 3).toarray()
        return Response({}, {self.output: basis[:, None, 1:]})


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Dynamics(_Decoy):
    """Other linear dynamics: the free run through several lags."""

    effect: str = "other dynamics"
    factors: int = len(LAGS) + 1
    most_of: float = 0.8  # lags between samples are not quite those of held signals

    @classmethod
    def of(cls, run: FreeRun, output: int) -> Self:
        """Return the rival of an output by its index."""
        place = f"process:{run.model.outputs[output]}"
        parts = [(place, name) for name in ("pole", "delay", "gain")]
        lags = [(f"valve:{valve}", "lag") for valve in run.model.valve_names]
        return cls(place=place, contains=(*parts, *lags), output=output)

    @property
    def absorbed(self) -> bool:
        return True

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        parts = []
        for rows in run.runs.slices:
            values = run.forced[rows, self.output]
            late = np.concatenate([values[:1], values[:-1]]) - values[0]
            columns = [values]
            for lag in LAGS:
                keep = np.exp(-1.0 / lag) if lag else 0.0
                columns.append(lfilter([1.0 - keep], [1.0, -keep], late))
            parts.append(np.column_stack(columns))
        return Response({}, {self.output: np.vstack(parts)[:, None, :]})


def decoys(run: FreeRun) -> list[Candidate]:
    """Return the rivals outside the catalogue for every output."""
    found: list[Candidate] = []
    for i in range(run.forced.shape[1]):
        found += [Trend.of(run, i)]
        if float(np.ptp(run.forced[:, i])) > 0.0:
            found += [GainChange.of(run, i), Dynamics.of(run, i)]
    return found
