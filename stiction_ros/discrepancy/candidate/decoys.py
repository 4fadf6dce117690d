"""Rivals outside the catalogue: they show that something is amiss which it does not name."""

from __future__ import annotations

import numpy as np

from stiction_ros.deferred import lfilter
from stiction_ros.discrepancy.candidate.base import Candidate, Response
from stiction_ros.discrepancy.candidate.output import OutputCandidate
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Axis, Behaviour, FloatArray

KNOTS = 6
LAGS = (0.0, 2.0, 6.0, 18.0)  # samples


class _Decoy(OutputCandidate):
    inside = False

    def behaviour(self, run: FreeRun, point: FloatArray, factors: FloatArray) -> Behaviour | None:
        return None


class GainChange(_Decoy):
    """A process whose gain changes at one moment."""

    factors = 2
    dated = True

    def __init__(self, run: FreeRun, output: int) -> None:
        """Take the output's index."""
        super().__init__(run, output, "process", "gain that changes")
        self.contains = (
            (f"disturbance:{run.model.outputs[output]}", "step"),
            *((f"load:{valve}", "step") for valve in run.model.valve_names),
        )
        last = float(run.runs.time.max())
        self.axes = (Axis(0.1 * last, 0.9 * last, 17),)

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        late = (run.runs.time[:, None] >= points[:, 0]).astype(float)
        free = run.forced[:, self.output, None] - run.forced[:, self.output].mean()
        return Response({}, {self.output: np.stack([late * free, late], axis=2)})


class Trend(_Decoy):
    """A slow unknown load: a cubic spline in time."""

    factors = KNOTS

    def __init__(self, run: FreeRun, output: int) -> None:
        """Take the output's index."""
        super().__init__(run, output, "disturbance", "slow load")
        places = [f"disturbance:{run.model.outputs[output]}"]
        places += [f"load:{valve}" for valve in run.model.valve_names]
        self.contains = tuple((place, "random_walk") for place in places)

    def respond(self, run: FreeRun, points: FloatArray) -> Response:
        from scipy.interpolate import BSpline

        at = run.runs.time / max(float(run.runs.time.max()), 1e-9)
        knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, KNOTS - 1), np.ones(3)])
        basis = BSpline.design_matrix(np.clip(at, 0.0, 1.0 - 1e-12), knots, 3).toarray()
        return Response({}, {self.output: basis[:, None, 1:]})


class Dynamics(_Decoy):
    """Other linear dynamics: the free run through several lags."""

    factors = len(LAGS) + 1

    def __init__(self, run: FreeRun, output: int) -> None:
        """Take the output's index."""
        super().__init__(run, output, "process", "other dynamics")
        tag = run.model.outputs[output]
        self.contains = (
            *((f"process:{tag}", name) for name in ("pole", "delay", "gain")),
            *((f"valve:{valve}", "lag") for valve in run.model.valve_names),
        )
        self.most_of = 0.8  # lags between samples are not quite those of held signals

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
        found += [Trend(run, i)]
        if float(np.ptp(run.forced[:, i])) > 0.0:
            found += [GainChange(run, i), Dynamics(run, i)]
    return found
