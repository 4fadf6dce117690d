"""A sampled equation as the continuous plant behind a stem that is held for a sample.

Dead time and time constants of a plant are continuous: with them a little longer, the equation
is another one in all its b.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from stiction_ros.effects import FloatArray

FRACTIONS = 41  # of a sample, at which the dead time's is looked for
EXACT = 1e-6  # of b, that the continuous plant may miss
NOTHING = 1e-9
SLIGHT = 1e-5  # of the largest power of s in a numerator, that is rounding

ComplexArray = NDArray[np.complex128]


@dataclasses.dataclass(frozen=True)
class Held:
    r"""One path of an equation in continuous time, in samples.

    .. math:: G(s) = \frac{n_0 + n_1 s + \ldots}{\prod_i (s - p_i)} e^{-f s}

    Attributes:
        poles: p, shape (n,).
        numerator: n₀ …, shape (n,).
        fraction: f, the dead time beyond whole samples, 0 to 1.
    """

    poles: ComplexArray
    numerator: FloatArray
    fraction: float

    def sampled(self) -> FloatArray:
        """Return b of the sampled equation, shape (n + 1,)."""
        return np.asarray(_answers(self.poles, self.fraction) @ self.numerator)


def held(denominator: FloatArray, b: FloatArray) -> Held | None:
    """Return the continuous plant whose sampled equation is given; None where none is.

    Args:
        denominator: 1, a₁, …, shape (n + 1,), its roots off the negative axis and not 0.
        b: one more than n at most.
    """
    roots = np.roots(denominator).astype(complex)
    count = len(roots)
    if not count or len(b) > count + 1 or np.any(np.abs(roots) < NOTHING):
        return None
    if np.any((roots.real < 0.0) & (np.abs(roots.imag) < NOTHING)):
        return None
    poles = np.log(np.where(np.abs(roots - 1.0) < NOTHING, 1.0, roots))
    wanted = np.concatenate([b, np.zeros(count + 1 - len(b))])

    def left(fraction: float) -> float:
        return _solved(poles, fraction, wanted)[1]

    if len(b) <= count:
        fraction = 0.0
    else:
        grid = np.linspace(0.0, 1.0, FRACTIONS)
        tried = [left(float(each)) for each in grid]
        best, width = float(grid[int(np.argmin(tried))]), float(grid[1])
        inside = (max(best - width, 0.0), min(best + width, 1.0))
        from scipy.optimize import minimize_scalar

        found = minimize_scalar(left, bounds=inside, method="bounded", options={"xatol": 1e-9})
        fraction = float(found.x)
    numerator, missed = _solved(poles, fraction, wanted)
    if not missed <= EXACT:
        return None
    return Held(poles, numerator, fraction)


def _solved(poles: ComplexArray, fraction: float, wanted: FloatArray) -> tuple[FloatArray, float]:
    """Return the numerator that is nearest to b, and the share of b that it misses."""
    answers = _answers(poles, fraction)
    scale = np.linalg.norm(answers, axis=0)
    numerator = np.linalg.lstsq(answers / scale, wanted, rcond=None)[0] / scale
    missed = float(np.linalg.norm(answers @ numerator - wanted))
    return numerator, missed / max(float(np.linalg.norm(wanted)), 1e-300)


def _answers(poles: ComplexArray, fraction: float) -> FloatArray:
    """Return b for numerators 1, s, s², …, shape (n + 1, n)."""
    count = len(poles)
    system = np.zeros((count + 1, count + 1))  # with the held stem as its last state
    system[:-2, 1:-1] = np.eye(count - 1)
    system[-2, :-1] = -np.real(np.poly(poles))[:0:-1]
    system[-2, -1] = 1.0
    late, early = expm(system * (1.0 - fraction)), expm(system * fraction)
    a_late, on_late = late[:-1, :-1], late[:-1, -1]
    a_early, on_early = early[:-1, :-1], early[:-1, -1]
    whole = a_late @ a_early
    states = [on_late, whole @ on_late + a_late @ on_early]
    while len(states) < count + 1:
        states.append(whole @ states[-1])
    pulse = np.array([np.zeros(count), *states])  # the states are y, its slope, …
    denominator = np.real(np.poly(np.exp(poles)))
    return np.column_stack(
        [np.convolve(denominator, pulse[:, i])[1 : count + 2] for i in range(count)]
    )


def later(plant: Held, samples: float) -> tuple[Held, int]:
    """Return the plant with more dead time, and the whole samples that it passes."""
    whole = math.floor(plant.fraction + samples + NOTHING)
    fraction = min(max(plant.fraction + samples - whole, 0.0), 1.0)
    return dataclasses.replace(plant, fraction=fraction), whole


def slower(plant: Held, stretches: FloatArray, led: FloatArray) -> Held:
    """Return the plant with longer time constants and leads, its gain as before.

    Args:
        plant: to be changed.
        stretches: factor of every pole's time constant, shape (n,); poles at 0 stay.
        led: factor of every zero's, in the order of :func:`zeros_of`.
    """
    poles = plant.poles / stretches
    moved = np.abs(plant.poles) > NOTHING
    level = float(np.real(np.prod(poles[moved] / plant.poles[moved])))
    highest = _trimmed(plant.numerator)[-1]
    other = highest * np.prod(led) * np.real(np.poly(zeros_of(plant) / led))
    other = np.atleast_1d(other)[::-1]
    padded = np.concatenate([other, np.zeros(len(plant.numerator) - len(other))])
    return Held(poles, level * padded, plant.fraction)


def zeros_of(plant: Held) -> ComplexArray:
    """Return the zeros of G(s), 1/sample, shape (zeros,)."""
    return np.roots(_trimmed(plant.numerator)[::-1]).astype(complex)


def _trimmed(numerator: FloatArray) -> FloatArray:
    """Return the numerator without powers of s that count for nothing."""
    sizes = np.abs(numerator) > SLIGHT * float(np.abs(numerator).max())
    return numerator[: int(np.flatnonzero(sizes)[-1]) + 1]
