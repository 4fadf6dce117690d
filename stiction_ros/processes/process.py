"""What every process is: stem positions in, process variables out, one sample at a time."""

import dataclasses
import enum
from abc import ABC, abstractmethod

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.processes.linear import LinearModel


class NoiseEntry(enum.StrEnum):
    """Where white noise enters: added to PV as in (2) and (A.2), or as v in (9)."""

    MEASUREMENT = "measurement"
    EQUATION = "equation"


@dataclasses.dataclass(frozen=True)
class Noise:
    """White Gaussian noise on one output, ``std`` in the units of the output."""

    std: float = 0.0
    enters: NoiseEntry = NoiseEntry.MEASUREMENT


class Process(ABC):
    """A process with m valves, p outputs and d further inputs that nobody manipulates."""

    kind: str
    valves: tuple[str, ...]  # names of the manipulated inputs, stem positions in %
    outputs: tuple[str, ...]  # names of the outputs
    noise: tuple[Noise, ...]  # one ``Noise`` per output
    upsets: tuple[str, ...] = ()  # names of the further inputs (disturbances), measured or not
    measured_disturbances: tuple[str, ...] = ()  # those of ``upsets`` that are measured

    @abstractmethod
    def rest(self, stem: FloatArray, pv: FloatArray) -> FloatArray:
        """Return the state in which the process has rested at ``stem`` (m,) and ``pv`` (p,).

        Where the two do not belong together, ``pv`` wins for the outputs' history.
        """

    @abstractmethod
    def advance(
        self, state: FloatArray, stem: FloatArray, upset: FloatArray, noise: FloatArray
    ) -> FloatArray:
        """Return the state one sample later.

        Args:
            state: shape (n,).
            stem: stem positions during the sample, shape (m,), %.
            upset: deviations of the further inputs from nominal, shape (d,).
            noise: equation noise v of the next sample, shape (p,).
        """

    @abstractmethod
    def output(self, state: FloatArray) -> FloatArray:
        """Return the undisturbed, noise-free outputs, shape (p,)."""

    @abstractmethod
    def linear(self, sample_time: float) -> LinearModel:
        """Return the discrete linear model about the operating point."""

    def noise_std(self, entry: NoiseEntry) -> FloatArray:
        """Return the standard deviations, shape (p,), of the noise that enters there."""
        return np.array([n.std if n.enters is entry else 0.0 for n in self.noise])
