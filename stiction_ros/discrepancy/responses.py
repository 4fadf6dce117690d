"""Responses of a process to stem positions, for many stems at once."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from scipy.signal import lfilter

from stiction_ros.effects import Filter, FloatArray, LinearFilter
from stiction_ros.processes import AlteredProcess, ArxProcess, LinearModel, Process, StirredTank


class Responses(ABC):
    """What a process makes of stem positions; state and level at the start are free columns.

    Attributes:
        skip: first samples of a run that depend on stems before it.
    """

    skip: int

    @abstractmethod
    def forced(self, output: int, stems: list[FloatArray]) -> FloatArray:
        """Return one output, shape (N, G), but for what :meth:`free` spans.

        Args:
            output: its index.
            stems: per valve positions in %, shape (N, G) or (N, 1).
        """

    @abstractmethod
    def free(self, output: int, stems: list[FloatArray]) -> FloatArray:
        """Return columns, shape (N, n): responses to the state at the start and a constant."""

    @abstractmethod
    def load(self, output: int, upset: str, values: FloatArray) -> FloatArray | None:
        """Return the response, shape (N, G), to deviations of a further input; None without."""


class LinearResponses(Responses):
    """Transfer functions of a linear process about its operating point."""

    def __init__(self, process: Process, sample_time: float) -> None:
        """Take ARX equations as they are, other linear processes by their matrices."""
        model = process.linear(sample_time)
        self.upsets = process.measured_disturbances
        count = len(process.outputs)
        if isinstance(process, ArxProcess):
            self._numerators, self._denominators = _of_equations(process)
            self.skip = max(n.size for row in self._numerators for n in row)
            self._rests = [_recursion_starts(d) for d in self._denominators]
        else:
            den = np.real(np.poly(model.a)) if model.order else np.ones(1)
            self._denominators = [den] * count
            self._numerators = [
                [_numerator(model, den, model.b[:, j], i) for j in range(model.b.shape[1])]
                for i in range(count)
            ]
            self.skip = 0
            self._rests = [_state_starts(model, den, i) for i in range(count)]
        self._loads = [
            [_numerator(model, self._denominators[i], model.e[:, d], i) for d in range(e)]
            for i in range(count)
            for e in [model.e.shape[1]]
        ]

    def forced(self, output: int, stems: list[FloatArray]) -> FloatArray:
        total: FloatArray | None = None
        for numerator, stem in zip(self._numerators[output], stems, strict=True):
            part = lfilter(numerator, self._denominators[output], stem - stem[:1], axis=0)
            total = part if total is None else total + part
        assert total is not None
        return np.asarray(total)

    def free(self, output: int, stems: list[FloatArray]) -> FloatArray:
        count = len(stems[0])
        denominator = self._denominators[output]
        columns = []
        for numerator in self._rests[output]:
            impulse = np.zeros(count)
            impulse[: len(numerator)] = numerator[:count]
            columns.append(lfilter([1.0], denominator, impulse))
        columns.append(lfilter([1.0], denominator, np.ones(count)))
        return np.column_stack(columns)

    def load(self, output: int, upset: str, values: FloatArray) -> FloatArray | None:
        if upset not in self.upsets:
            return None
        numerator = self._loads[output][self.upsets.index(upset)]
        return np.asarray(lfilter(numerator, self._denominators[output], values, axis=0))


class TankResponses(Responses):
    """The stirred tank itself: with its valves given, C and T obey linear equations each.

    One sample of (A.1) by the Runge-Kutta method of :meth:`StirredTank.advance` is affine in
    the state, x_{k+1} = r_k x_k + s_k, with r and s known from the stems of the sample.
    """

    skip = 0

    def __init__(self, tank: StirredTank) -> None:
        """Take the tank's own parameters and step."""
        self.tank = tank

    def _steps(self, output: int, stems: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
        p = self.tank.parameters
        flow_a = p.flow_a_max * stems[0] / 100.0
        if output == 0:
            inlet = flow_a * p.concentration_a + p.flow_b * p.concentration_b
        else:
            steam = p.steam_max * stems[1] / 100.0
            inlet = flow_a * p.temperature_a + p.flow_b * p.temperature_b
            inlet = inlet + steam * p.latent_heat / (p.density * p.heat_capacity)
        return self._affine(flow_a + p.flow_b, inlet)

    def _affine(self, out: FloatArray, inlet: FloatArray) -> tuple[FloatArray, FloatArray]:
        h = self.tank.sample_time / 60.0
        z = -out * h / self.tank.parameters.volume
        tail = 1.0 + z / 2.0 + z**2 / 6.0 + z**3 / 24.0
        return 1.0 + z * tail, h / self.tank.parameters.volume * inlet * tail

    def forced(self, output: int, stems: list[FloatArray]) -> FloatArray:
        ratio, source = self._steps(output, stems)
        ratio, source = np.broadcast_arrays(ratio, source)
        state = source[0] / (1.0 - ratio[0])
        out = np.empty(source.shape)
        for k in range(len(out)):
            out[k] = state
            state = ratio[k] * state + source[k]
        return out

    def free(self, output: int, stems: list[FloatArray]) -> FloatArray:
        ratio = self._steps(output, [stem[:, :1] for stem in stems])[0][:, 0]
        start = np.concatenate([[1.0], np.cumprod(ratio)[:-1]])
        return np.column_stack([start, np.ones(len(ratio))])

    def load(self, output: int, upset: str, values: FloatArray) -> FloatArray | None:
        return None


class AlteredResponses(Responses):
    """Another process's responses behind the linear effects on its outputs."""

    def __init__(self, process: AlteredProcess, sample_time: float) -> None:
        """Take the process without its effects, and these as filters."""
        self._inner = responses_of(process.inner, sample_time)
        self.skip = self._inner.skip
        self._filters = [
            [_of_filter(e.filter(sample_time)) for e in chain if isinstance(e, LinearFilter)]
            for chain in process.effects
        ]

    def _pass(self, output: int, values: FloatArray) -> FloatArray:
        for numerator, denominator in self._filters[output]:
            values = lfilter(numerator, denominator, values, axis=0)
        return values

    def forced(self, output: int, stems: list[FloatArray]) -> FloatArray:
        inner = self._inner.forced(output, stems)
        return self._pass(output, inner - inner[:1])

    def free(self, output: int, stems: list[FloatArray]) -> FloatArray:
        columns = [self._pass(output, self._inner.free(output, stems))]
        impulse = np.eye(len(stems[0]), 1)
        for numerator, denominator in self._filters[output]:
            for lag in range(min(len(denominator) - 1, 2)):
                columns.append(lfilter([1.0], denominator, np.roll(impulse, lag, axis=0), axis=0))
            if len(denominator) == 1 and len(numerator) > 1:
                columns.append(np.eye(len(impulse), min(len(numerator) - 1, 2)))
        columns.append(np.ones((len(impulse), 1)))
        return np.hstack(columns)

    def load(self, output: int, upset: str, values: FloatArray) -> FloatArray | None:
        inner = self._inner.load(output, upset, values)
        return None if inner is None else self._pass(output, inner)


def responses_of(process: Process, sample_time: float) -> Responses:
    """Return the responses of a process."""
    if isinstance(process, AlteredProcess):
        return AlteredResponses(process, sample_time)
    if isinstance(process, StirredTank):
        return TankResponses(process)
    return LinearResponses(process, sample_time)


def _of_equations(process: ArxProcess) -> tuple[list[list[FloatArray]], list[FloatArray]]:
    numerators, denominators = [], []
    for equation in process.equations:
        row = []
        for valve in process.valves:
            if valve not in equation.b:
                row.append(np.zeros(1))
                continue
            row.append(np.concatenate([np.zeros(1 + equation.delay[valve]), equation.b[valve]]))
        numerators.append(row)
        denominators.append(np.concatenate([[1.0], equation.a]))
    return numerators, denominators


def _recursion_starts(denominator: FloatArray) -> list[FloatArray]:
    """Return impulses at the first n_a samples: together they reach every past of an equation."""
    return [np.eye(len(denominator) - 1)[i] for i in range(len(denominator) - 1)]


def _numerator(
    model: LinearModel, denominator: FloatArray, column: FloatArray, output: int
) -> FloatArray:
    """Return the numerator of C (qI − A)⁻¹ b in powers of q⁻¹."""
    impulse, state = [0.0], column
    for _ in range(model.order):
        impulse.append(float(model.c[output] @ state))
        state = model.a @ state
    return np.asarray(np.convolve(denominator, impulse)[: model.order + 1])


def _state_starts(model: LinearModel, denominator: FloatArray, output: int) -> list[FloatArray]:
    """Return the numerators of the responses to each state at the start."""
    rows, row = [], model.c[output]
    for _ in range(model.order):
        rows.append(row)
        row = row @ model.a
    responses = np.array(rows).reshape(model.order, model.order)
    return [np.convolve(denominator, responses[:, i])[: model.order] for i in range(model.order)]


def _of_filter(entry: Filter) -> tuple[FloatArray, FloatArray]:
    """Return numerator and denominator in powers of q⁻¹, common zeros at the end cut off."""
    size = len(entry.b)
    denominator = np.real(np.poly(entry.a)) if size else np.ones(1)
    impulse, state = [entry.d], entry.b
    for _ in range(size):
        impulse.append(float(entry.c @ state))
        state = entry.a @ state
    numerator = np.convolve(denominator, impulse)[: size + 1]
    while len(denominator) > 1 and denominator[-1] == 0.0:
        denominator = denominator[:-1]
    return np.asarray(numerator), np.asarray(denominator)
