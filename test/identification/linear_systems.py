"""Random stable linear systems and their records, for the tests of linear identification."""

import dataclasses

import numpy as np
from scipy.signal import lfilter

from stiction_ros.effects import FloatArray
from stiction_ros.loop import random_binary
from stiction_ros.records.record import Record


@dataclasses.dataclass(frozen=True)
class System:
    """A, B, C with all poles well inside the unit circle and no state that hides."""

    a: FloatArray
    b: FloatArray
    c: FloatArray

    def markov(self, count: int) -> FloatArray:
        """Return C A^i B for i < count, shape (count, p, m)."""
        powers = [np.linalg.matrix_power(self.a, i) for i in range(count)]
        return np.array([self.c @ power @ self.b for power in powers])

    def run(self, u: FloatArray, x0: FloatArray) -> FloatArray:
        """Return the outputs, shape (N, p)."""
        state, out = x0, np.empty((len(u), len(self.c)))
        for k, row in enumerate(u):
            out[k] = self.c @ state
            state = self.a @ state + self.b @ row
        return out


def random_system(random: np.random.Generator, order: int, valves: int, outputs: int) -> System:
    """Return a system with distinct poles between 0.3 and 0.92, in a random basis."""
    poles = np.linspace(0.3, 0.92, order) + 0.02 * random.uniform(-1.0, 1.0, order)
    basis = np.linalg.qr(random.standard_normal((order, order)))[0]
    signs = random.choice([-1.0, 1.0], (order, valves + outputs))
    mixed = signs * random.uniform(0.5, 1.5, (order, valves + outputs))
    # (1 − pole) makes the modes alike in gain, so that none drowns.
    b = basis @ (mixed[:, :valves] * (1.0 - poles)[:, None])
    return System(basis @ np.diag(poles) @ basis.T, b, mixed[:, valves:].T @ basis.T)


def experiment(
    system: System, random: np.random.Generator, samples: int, noise: float = 0.0
) -> Record:
    """Return an open-loop record about 50 % and an offset; ``noise`` is added to PV."""
    m, p = system.b.shape[1], len(system.c)
    op = random_binary(random, samples, m, 0.2, (45.0, 55.0))
    pv = system.run(op - 50.0, random.standard_normal(len(system.a))) + 20.0
    pv = pv + noise * random.standard_normal(pv.shape)
    valves = tuple(f"V{j + 1}" for j in range(m))
    return Record("system", 1.0, valves, tuple(f"PV{i + 1}" for i in range(p)), op, pv)


def armax_record(
    random: np.random.Generator,
    samples: int,
    a: tuple[float, ...],
    b: tuple[tuple[float, ...], ...],
    c: tuple[float, ...],
    delays: tuple[int, ...],
    noise: float,
) -> Record:
    """Return a record of A y = Σ B_j χ_j + C e about 50 % and 20 units of PV."""
    op = random_binary(random, samples, len(b), 0.1, (45.0, 55.0))
    y = lfilter([1.0, *c], [1.0, *a], noise * random.standard_normal(samples))
    for column, coefficients, delay in zip(op.T, b, delays, strict=True):
        y = y + lfilter([0.0] * (delay + 1) + list(coefficients), [1.0, *a], column - 50.0)
    valves = tuple(f"V{j + 1}" for j in range(len(b)))
    return Record("armax", 1.0, valves, ("PV1",), op, y[:, None] + 20.0)
