"""What of an equation may be a few per cent off: gain, time constants, leads, dead time."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from stiction_ros.discrepancy.process.free_equation import Equation
from stiction_ros.discrepancy.process.held import (
    NOTHING,
    ComplexArray,
    Held,
    held,
    later,
    slower,
    zeros_of,
)
from stiction_ros.effects import FloatArray

GAIN, TIME_CONSTANT, LEAD, DELAY = "gain", "time_constant", "lead", "delay"
MOST = {GAIN: 0.15, TIME_CONSTANT: 0.2, LEAD: 0.2, DELAY: 1.0}
"""Logarithms and samples; beyond that it is an effect, not an error of the model."""
OF_DELAY = 0.1  # of the model's dead time, beside the sample to which it may be rounded
PROBES = {GAIN: 0.01, TIME_CONSTANT: 0.01, LEAD: 0.01, DELAY: 0.1}  # of the derivatives
SHORTEST = 1.0  # sample, of a time constant that counts


@dataclasses.dataclass(frozen=True)
class Figure:
    """One figure of an equation that may be off.

    Attributes:
        what: ``gain``, ``time_constant``, ``lead`` or ``delay``.
        most: the largest change, as a logarithm, of a delay in samples.
        roots: which poles or zeros it moves; a pair moves together.
        valve: whose zeros; None for poles.
        lasts: time constant, samples; None for gain and delay.
    """

    what: str
    most: float
    roots: tuple[int, ...] = ()
    valve: int | None = None
    lasts: float | None = None

    @property
    def probe(self) -> float:
        """Change by which a derivative is taken."""
        return PROBES[self.what]


class Changeable:
    """An equation whose figures may be changed.

    Where it is that of a continuous plant behind a held stem, the changed one is so, too. Of
    others a longer dead time is a mean of whole ones, and their zeros stay.

    Attributes:
        own: as the model has it.
        figures: that may be off.
    """

    def __init__(self, own: Equation) -> None:
        """Take the equation."""
        self.own = own
        plants = [held(own.denominator, b) if len(b) else None for b in own.b]
        known = all(plant is not None or not len(b) for plant, b in zip(plants, own.b, strict=True))
        self._plants: list[Held | None] | None = plants if known else None
        self._poles = np.roots(own.denominator).astype(complex)
        whole = np.where(np.abs(self._poles) < NOTHING, NOTHING, self._poles)
        late = MOST[DELAY] + OF_DELAY * max(own.delay)
        self.figures = [Figure(GAIN, MOST[GAIN]), Figure(DELAY, late)]
        self.figures += _of_roots(np.log(whole), TIME_CONSTANT, None)
        for j, plant in enumerate(plants if known else []):
            if plant is not None:
                self.figures += _of_roots(zeros_of(plant), LEAD, j)

    def changed(self, values: FloatArray) -> Equation:
        """Return the equation with its figures changed, logarithms and samples, shape (figures,).

        Its gain is changed by ``gain`` alone.
        """
        if not values.any():
            return self.own
        by_name = dict.fromkeys((GAIN, DELAY), 0.0)
        for figure, value in zip(self.figures, values.tolist(), strict=True):
            if figure.what in by_name:
                by_name[figure.what] += value
        gain, late = math.exp(by_name[GAIN]), by_name[DELAY]
        stretches = self._factors(values, TIME_CONSTANT, None, len(self._poles))
        if self._plants is None:
            return self._of_means(gain, late, stretches)
        b, delays = [], []
        poles = self._poles
        for j, (plant, each, delay) in enumerate(
            zip(self._plants, self.own.b, self.own.delay, strict=True)
        ):
            if plant is None:
                b.append(each)
                delays.append(delay)
                continue
            led = self._factors(values, LEAD, j, len(zeros_of(plant)))
            other, more = later(slower(plant, stretches, led), max(late, -float(delay)))
            poles = np.exp(other.poles)
            b.append(gain * other.sampled())
            delays.append(max(delay + more, 0))
        return Equation(np.real(np.poly(poles))[1:], tuple(b), tuple(delays))

    def _factors(self, values: FloatArray, what: str, valve: int | None, count: int) -> FloatArray:
        factors = np.ones(count)
        for figure, value in zip(self.figures, values.tolist(), strict=True):
            if (figure.what, figure.valve) == (what, valve):
                factors[list(figure.roots)] = math.exp(value)
        return factors

    def _of_means(self, gain: float, late: float, stretches: FloatArray) -> Equation:
        own, poles = self.own, self._poles
        moved = stretches != 1.0
        slow = poles.copy()
        slow[moved] = np.exp(np.log(poles[moved]) / stretches[moved])
        level = float(np.real(np.prod((1.0 - slow[moved]) / (1.0 - poles[moved]))))
        b, delays = [], []
        for each, delay in zip(own.b, own.delay, strict=True):
            whole = math.floor(max(delay + late, 0.0))
            share = max(delay + late, 0.0) - whole
            b.append(gain * level * np.convolve(each, [1.0 - share, share]) if len(each) else each)
            delays.append(whole if len(each) else delay)
        a = np.real(np.poly(slow))[1:] if len(slow) else own.a
        return Equation(np.asarray(a), tuple(b), tuple(delays))


def _of_roots(roots: ComplexArray, what: str, valve: int | None) -> list[Figure]:
    """Return a figure for every root of G(s), in 1/sample, that lasts a sample, pairs as one."""
    found = []
    for k, root in enumerate(roots.tolist()):
        pace = abs(root)
        swings = abs(root.imag)
        if root.imag < -NOTHING or not NOTHING < pace <= 1.0 / SHORTEST:
            continue  # one of a pair stands for both
        pair: tuple[int, ...] = (k,)
        if swings > NOTHING:
            pair = tuple(np.flatnonzero(np.abs(roots - root.conjugate()) < NOTHING).tolist())
            pair = (k, *pair)
        found.append(Figure(what, MOST[what], pair, valve, 1.0 / pace))
    return found
