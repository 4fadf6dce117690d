"""Responses of a process to stem positions, for many stems at once."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.deferred import lfilter
from stiction_ros.effects import Filter, FloatArray
from stiction_ros.processes import AlteredProcess, ArxProcess, Process, StirredTank


@compiled
def filtered(
    taps: FloatArray, denominator: FloatArray, stems: FloatArray, more: FloatArray
) -> FloatArray:
    """Return y_k = Σ taps_i (x_{k−i} − x_0) + more_k − Σ a_i y_{k−i}, at rest before the start.

    Args:
        taps: shape (n,).
        denominator: 1, a_1, … a_n.
        stems: x, shape (N, G).
        more: shape (N,), for all columns.
    """
    count, size = stems.shape
    out = np.empty((count, size))
    for k in range(count):
        for g in range(size):
            out[k, g] = more[k]
        for i in range(min(len(taps), k)):
            factor = taps[i]
            if factor != 0.0:
                for g in range(size):
                    out[k, g] += factor * (stems[k - i, g] - stems[0, g])
        for i in range(1, min(len(denominator), k + 1)):
            factor = denominator[i]
            for g in range(size):
                out[k, g] -= factor * out[k - i, g]
    return out


@compiled
def tank_states(
    first: FloatArray, second: FloatArray, flow: FloatArray, inlet: FloatArray, share: float
) -> FloatArray:
    """Return C or T of the stirred tank from rest, shape (N, G).

    Args:
        first, second: stems of both valves, shape (N, G) or (N, 1), %.
        flow: outflow is flow_0 + flow_1 x_1, m³/min.
        inlet: what flows in is inlet_0 + inlet_1 x_1 + inlet_2 x_2.
        share: sample time over volume, min/m³.
    """
    count = len(first)
    size = max(first.shape[1], second.shape[1])
    one, two = int(first.shape[1] > 1), int(second.shape[1] > 1)
    states = np.empty((count, size))
    state = np.empty(size)
    for k in range(count):
        for g in range(size):
            a, b = first[k, g * one], second[k, g * two]
            z = -share * (flow[0] + flow[1] * a)
            tail = 1.0 + z * (0.5 + z * (1.0 / 6.0 + z / 24.0))
            source = share * (inlet[0] + inlet[1] * a + inlet[2] * b) * tail
            if k == 0:
                state[g] = -source / (z * tail)
            states[k, g] = state[g]
            state[g] = (1.0 + z * tail) * state[g] + source
    return states


def end_to_end(parts: Sequence[FloatArray]) -> FloatArray:
    """Return the parts of every record below each other; one alone is not copied."""
    return parts[0] if len(parts) == 1 else np.vstack(parts)


class Responses(ABC):
    """What a process makes of stem positions; state and level at the start are free columns."""

    skip: int  # first samples of a run that depend on stems before it

    @abstractmethod
    def forced(self, output: int, stems: list[FloatArray]) -> FloatArray:
        """Return one output, shape (N, G), but for what :meth:`free` spans.

        Args:
            output: its index.
            stems: per valve positions in %, shape (N, G) or (N, 1).
        """

    @abstractmethod
    def reaches(self, output: int, valve: int) -> bool:
        """Return whether a valve moves an output."""

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
            self._rests = [list(np.eye(len(d) - 1)) for d in self._denominators]
        else:
            den = np.real(np.poly(model.a)) if model.order else np.ones(1)
            self._denominators = [den] * count
            self._numerators = [
                [_numerator(model.a, b, c, den) for b in model.b.T] for c in model.c
            ]
            self.skip = 0
            starts = np.eye(model.order)  # a state at the start is an impulse one sample before
            self._rests = [[_numerator(model.a, x, c, den)[1:] for x in starts] for c in model.c]
        self._loads = [
            [_numerator(model.a, e, c, denominator) for e in model.e.T]
            for c, denominator in zip(model.c, self._denominators, strict=True)
        ]

    def forced(self, output: int, stems: list[FloatArray]) -> FloatArray:
        count, denominator = len(stems[0]), self._denominators[output]
        pairs = list(zip(self._numerators[output], stems, strict=True))
        many = [pair for pair in pairs if pair[1].shape[1] > 1] or pairs[:1]
        more = np.zeros(count)
        for numerator, stem in pairs:
            if all(stem is not other for _, other in many):
                more += np.convolve(numerator, stem[:, 0] - stem[0, 0])[:count]
        total = filtered(many[0][0], denominator, np.ascontiguousarray(many[0][1]), more)
        for numerator, stem in many[1:]:
            total += filtered(numerator, denominator, np.ascontiguousarray(stem), np.zeros(count))
        return total

    def reaches(self, output: int, valve: int) -> bool:
        return bool(self._numerators[output][valve].any())

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

        p = tank.parameters
        self._share = tank.sample_time / 60.0 / p.volume
        self._flow = np.array([p.flow_b, p.flow_a_max / 100.0])
        heat = p.latent_heat / (p.density * p.heat_capacity)
        of_a, of_b = p.flow_a_max / 100.0, p.flow_b
        self._inlets = (
            np.array([of_b * p.concentration_b, of_a * p.concentration_a, 0.0]),
            np.array([of_b * p.temperature_b, of_a * p.temperature_a, p.steam_max / 100.0 * heat]),
        )

    def forced(self, output: int, stems: list[FloatArray]) -> FloatArray:
        first, second = (np.ascontiguousarray(stem) for stem in stems)
        if not self.reaches(output, 1):
            second = second[:, :1].copy()
        return tank_states(first, second, self._flow, self._inlets[output], self._share)

    def reaches(self, output: int, valve: int) -> bool:
        return bool(valve == 0 or self._inlets[output][2] != 0.0)

    def free(self, output: int, stems: list[FloatArray]) -> FloatArray:
        z = -self._share * (self._flow[0] + self._flow[1] * stems[0][:, 0])
        ratio = 1.0 + z * (1.0 + z / 2.0 + z**2 / 6.0 + z**3 / 24.0)
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
            [_of_filter(f) for e in chain if (f := e.filter(sample_time)) is not None]
            for chain in process.effects
        ]

    def _pass(self, output: int, values: FloatArray) -> FloatArray:
        """Return what the effects make of values that were zero before the start."""
        for numerator, denominator in self._filters[output]:
            values = lfilter(numerator, denominator, values, axis=0)
        return values

    def forced(self, output: int, stems: list[FloatArray]) -> FloatArray:
        values, rest = self._inner.forced(output, stems), np.zeros(len(stems[0]))
        values -= values[:1].copy()
        for numerator, denominator in self._filters[output]:
            values = filtered(numerator, denominator, values, rest)  # its first row is zero
        return values

    def reaches(self, output: int, valve: int) -> bool:
        return self._inner.reaches(output, valve)

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


def _numerator(
    a: FloatArray, b: FloatArray, c: FloatArray, denominator: FloatArray, d: float = 0.0
) -> FloatArray:
    """Return the numerator of C (qI − A)⁻¹ b + d in powers of q⁻¹."""
    impulse, state = [d], b
    for _ in range(len(b)):
        impulse.append(float(c @ state))
        state = a @ state
    return np.asarray(np.convolve(denominator, impulse)[: len(b) + 1])


def _of_filter(entry: Filter) -> tuple[FloatArray, FloatArray]:
    """Return numerator and denominator in powers of q⁻¹, common zeros at the end cut off."""
    size = len(entry.b)
    denominator = np.real(np.poly(entry.a)) if size else np.ones(1)
    numerator = _numerator(entry.a, entry.b, entry.c, denominator, entry.d)
    while len(denominator) > 1 and denominator[-1] == 0.0:
        denominator = denominator[:-1]
    return numerator, np.asarray(denominator)
