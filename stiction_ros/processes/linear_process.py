"""Processes that are linear: ARX equations with delays, and state space."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.processes.process import LinearModel, Noise, Process


class LinearProcess(Process):
    """A process that is its :class:`LinearModel`; shared by ARX and state space."""

    model: LinearModel
    noise_gain: FloatArray  # (n, p): how equation noise enters the states

    def rest(self, stem: FloatArray, pv: FloatArray) -> FloatArray:
        """Return the least-norm correction of the steady state at ``stem`` that gives ``pv``."""
        model = self.model
        drive = model.b @ (stem - model.stem0) + model.constant
        steady = np.linalg.lstsq(np.eye(model.order) - model.a, drive, rcond=None)[0]
        miss = pv - model.pv0 - model.c @ steady
        return np.asarray(steady + np.linalg.lstsq(model.c, miss, rcond=None)[0])

    def advance(
        self, state: FloatArray, stem: FloatArray, upset: FloatArray, noise: FloatArray
    ) -> FloatArray:
        model = self.model
        following = model.a @ state + model.b @ (stem - model.stem0) + model.constant
        if upset.size:
            following = following + model.e @ upset
        return np.asarray(following + self.noise_gain @ noise)

    def output(self, state: FloatArray) -> FloatArray:
        return np.asarray(self.model.c @ state + self.model.pv0)

    def linear(self, sample_time: float) -> LinearModel:
        return self.model


@dataclasses.dataclass(frozen=True)
class ArxOutput:
    """One output's difference equation (7)-(9)."""

    name: str  # tag of the output
    a: tuple[float, ...]  # a₁ … a_na, sign as in (8a)
    b: Mapping[str, tuple[float, ...]]  # per valve b₁ … b_nb
    delay: Mapping[str, int]  # per valve t_d in samples; χ enters at k − 1 − t_d
    bias: float = 0.0  # constant on the right-hand side, units of the output
    noise: Noise = Noise()  # v of (9), or noise added to the measurement

    def __post_init__(self) -> None:
        if set(self.b) != set(self.delay):
            raise InputError("b and delay name different valves", where=self.name)
        for valve, delay in self.delay.items():
            if delay < 0:
                raise InputError(f"delay of {valve} is negative", where=self.name)
            if not self.b[valve]:
                raise InputError(f"b of {valve} is empty", where=self.name)

    def to_mapping(self) -> dict[str, Any]:
        """Return the entry of ``process.outputs`` in a loop model."""
        return {
            "name": self.name,
            "a": [float(value) for value in self.a],
            "b": {valve: [float(value) for value in taps] for valve, taps in self.b.items()},
            "delay": {valve: int(delay) for valve, delay in self.delay.items()},
            "bias": float(self.bias),
            "noise": {"std": float(self.noise.std), "enters": self.noise.enters.value},
        }

    @property
    def order(self) -> int:
        """Number of states of the observer form: the longest reach into the past."""
        reach = [len(self.a), 1]
        reach += [len(b) + self.delay[valve] for valve, b in self.b.items()]
        return max(reach)


class ArxProcess(LinearProcess):
    """MISO ARX equations (7)-(9), realised in observer form so that y_k is a state."""

    kind = "arx"

    def __init__(
        self,
        equations: tuple[ArxOutput, ...],
        valves: tuple[str, ...],
        op0: FloatArray,
        pv0: FloatArray,
    ) -> None:
        """Build from one equation per output, in deviations from ``op0`` and ``pv0``."""
        self.equations = equations
        self.valves = valves
        self.outputs = tuple(equation.name for equation in equations)
        self.noise = tuple(equation.noise for equation in equations)
        order = sum(equation.order for equation in equations)
        a, b = np.zeros((order, order)), np.zeros((order, len(valves)))
        c, constant = np.zeros((len(equations), order)), np.zeros(order)
        self.noise_gain = np.zeros((order, len(equations)))
        first = 0
        for i, equation in enumerate(equations):
            n = equation.order
            a[first : first + n - 1, first + 1 : first + n] = np.eye(n - 1)
            a[first : first + len(equation.a), first] -= equation.a
            for valve, coefficients in equation.b.items():
                row = first + equation.delay[valve]
                b[row : row + len(coefficients), valves.index(valve)] += coefficients
            constant[first] = equation.bias
            c[i, first] = self.noise_gain[first, i] = 1.0
            first += n
        self.model = LinearModel(a, b, c, np.zeros((order, 0)), constant, op0, pv0)


class StateSpaceProcess(LinearProcess):
    """Matrices A, B, C (and E for measured disturbances) as in (2) and (A.3)."""

    kind = "state_space"

    def __init__(
        self,
        model: LinearModel,
        valves: tuple[str, ...],
        outputs: tuple[str, ...],
        noise: tuple[Noise, ...],
        measured_disturbances: tuple[str, ...] = (),
    ) -> None:
        """Wrap ``model``; equation noise enters through the least-norm inverse of C."""
        if len(measured_disturbances) != model.e.shape[1]:
            raise InputError(
                f"e has {model.e.shape[1]} columns for {len(measured_disturbances)} inputs",
                where="e",
                fix="give one column per name in measured_disturbances",
            )
        self.model = model
        self.valves, self.outputs, self.noise = valves, outputs, noise
        self.upsets = self.measured_disturbances = measured_disturbances
        self.noise_gain = np.asarray(np.linalg.pinv(model.c))
