"""Changes that the catalogue does not hold: a gain that changes, a fouling or leaking tank."""

import dataclasses

import numpy as np

from stiction_ros.effects import FloatArray
from stiction_ros.processes import LinearModel, Process, StirredTank


class _Clocked(Process):
    """Another process whose state ends with the number of samples since the start."""

    def __init__(self, inner: Process) -> None:
        self.inner = inner
        self.kind, self.valves, self.outputs = inner.kind, inner.valves, inner.outputs
        self.noise, self.upsets = inner.noise, inner.upsets
        self.measured_disturbances = inner.measured_disturbances

    def rest(self, stem: FloatArray, pv: FloatArray) -> FloatArray:
        return np.append(self.inner.rest(stem, pv), 0.0)

    def output(self, state: FloatArray) -> FloatArray:
        return self.inner.output(state[:-1])

    def linear(self, sample_time: float) -> LinearModel:
        return self.inner.linear(sample_time)


class ChangingGain(_Clocked):
    """A linear process whose gain changes by ``factor`` at sample ``onset``.

    Stems act in deviations from where they start, so that PV does not jump at the change.
    """

    def __init__(self, inner: Process, factor: float, onset: int) -> None:
        """Wrap ``inner``, which is linear."""
        super().__init__(inner)
        self.factor, self.onset = factor, onset
        self._point = inner.linear(1.0).stem0

    def advance(
        self, state: FloatArray, stem: FloatArray, upset: FloatArray, noise: FloatArray
    ) -> FloatArray:
        factor = self.factor if state[-1] >= self.onset else 1.0
        moved = self._point + factor * (stem - self._point)
        return np.append(self.inner.advance(state[:-1], moved, upset, noise), state[-1] + 1.0)


class AgeingTank(_Clocked):
    r"""A stirred tank that loses heat, and whose steam condenses on fouled walls, ever more.

    .. math::
        \dot T \mathrel{-}= \kappa k (T - T_a), \quad W \leftarrow W (1 - \phi k)

    with k the sample, T_a the temperature of stream A, κ ``loss`` in 1/min and φ ``fouling``
    per sample.
    """

    def __init__(self, inner: StirredTank, loss: float, fouling: float) -> None:
        """Wrap ``inner``."""
        super().__init__(inner)
        self.loss, self.fouling = loss, fouling
        self._minutes = inner.sample_time / 60.0
        self._around = inner.parameters.temperature_a

    def advance(
        self, state: FloatArray, stem: FloatArray, upset: FloatArray, noise: FloatArray
    ) -> FloatArray:
        age = float(state[-1])
        steam = np.array([stem[0], stem[1] * max(1.0 - self.fouling * age, 0.0)])
        following = self.inner.advance(state[:-1], steam, upset, noise)
        lost = self.loss * age * self._minutes * (float(state[1]) - self._around)
        return np.array([following[0], following[1] - lost, age + 1.0])


@dataclasses.dataclass(frozen=True)
class Outside:
    """A change outside the catalogue: its name, and the process that has it."""

    name: str
    process: Process


def changing_gain(random: np.random.Generator, process: Process, samples: int) -> Outside:
    """Return a gain that grows by 50 to 120 %, or falls as much, somewhere half-way."""
    factor = float(random.uniform(1.5, 2.2)) ** float(random.choice((-1.0, 1.0)))
    onset = int(random.uniform(0.35, 0.65) * samples)
    return Outside("gain that changes", ChangingGain(process, factor, onset))


def ageing_tank(random: np.random.Generator, process: Process, samples: int) -> Outside:
    """Return a tank that loses heat, or fouls, by an amount that grows over the record."""
    assert isinstance(process, StirredTank)
    if random.random() < 0.5:
        loss = float(random.uniform(0.01, 0.03)) / samples
        return Outside("heat loss that grows", AgeingTank(process, loss, 0.0))
    fouling = float(random.uniform(0.15, 0.4)) / samples
    return Outside("fouling that grows", AgeingTank(process, 0.0, fouling))
