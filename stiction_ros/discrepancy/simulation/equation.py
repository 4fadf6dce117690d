"""An equation with another gain, time constant, lead or dead time, or with one more lag."""

import dataclasses
import functools
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from stiction_ros.discrepancy.measures import ALL_AROUND, EPSILON, NEGLIGIBLE, ROUNDING
from stiction_ros.effects import FloatArray
from stiction_ros.processes import AlteredProcess, ArxOutput, ArxProcess, Process
from stiction_ros.processes.sampled import pulses

EXACT = EPSILON**0.5
"""Half of all digits: the share of b that a plant may miss, and what counts as 0 in a numerator."""

ComplexArray = NDArray[np.complex128]


@dataclasses.dataclass(frozen=True)
class Held:
    r"""One path of an equation in continuous time, in samples.

    .. math:: G(s) = \frac{n_0 + n_1 s + \ldots}{\prod_i (s - p_i)} e^{-f s}
    """

    poles: ComplexArray  # p, shape (n,)
    numerator: FloatArray  # n₀ …, shape (n,)
    fraction: float  # f, the dead time beyond whole samples, 0 to 1

    def sampled(self) -> FloatArray:
        """Return b of the sampled equation, shape (n + 1,)."""
        return np.asarray(_answers(self.poles, self.fraction) @ self.numerator)


@functools.lru_cache(maxsize=100)
def held(denominator: tuple[float, ...], b: tuple[float, ...]) -> Held | None:
    """Return the continuous plant whose sampled equation is given; None where none is.

    Args:
        denominator: 1, a₁, …, n + 1 of them, its roots off the negative axis and not 0.
        b: one more than n at most.
    """
    roots = np.roots(denominator).astype(complex)
    count = len(roots)
    if not count or len(b) > count + 1 or np.any(np.abs(roots) < ROUNDING):
        return None
    if np.any((roots.real < 0.0) & (np.abs(roots.imag) < ROUNDING)):
        return None
    poles = np.log(np.where(np.abs(roots - 1.0) < ROUNDING, 1.0, roots))
    wanted = np.array([*b, *[0.0] * (count + 1 - len(b))])

    def left(fraction: float) -> float:
        return _solved(poles, fraction, wanted)[1] ** 2  # near its least value a parabola

    if len(b) <= count:
        fraction = 0.0
    else:
        grid = np.linspace(0.0, 1.0, ALL_AROUND)
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
    states, denominator = pulses(np.real(np.poly(poles)), fraction, 1.0)
    answers = [np.convolve(denominator, pulse)[: len(pulse)] for pulse in states[::-1]]
    return np.column_stack(answers)


def later(plant: Held, samples: float) -> tuple[Held, int]:
    """Return the plant with more dead time, and the whole samples that it passes."""
    whole = math.floor(plant.fraction + samples + ROUNDING)
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
    moved = np.abs(plant.poles) > ROUNDING
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
    sizes = np.abs(numerator) > EXACT * float(np.abs(numerator).max())
    return numerator[: int(np.flatnonzero(sizes)[-1]) + 1]


GAIN, TIME_CONSTANT, LEAD, DELAY = "gain", "time_constant", "lead", "delay"
MOST = dict.fromkeys((GAIN, TIME_CONSTANT, LEAD), 3.0) | {DELAY: 10.0}
"""Shares and samples that a figure may be larger; beyond that it is another plant."""


@dataclasses.dataclass(frozen=True)
class Figure:
    """One figure of an equation that may be off."""

    what: str  # ``gain``, ``time_constant``, ``lead`` or ``delay``
    # least, most: the largest changes, a share of the model's figure, of a delay in samples. With
    # the least one a delay, a time constant or a lead is gone
    least: float
    most: float
    roots: tuple[int, ...] = ()  # which poles or zeros it moves; a pair moves together
    valve: str | None = None  # whose zeros; None for poles
    lasts: float | None = None  # time constant, samples; None for gain and delay


class Changeable:
    """An equation whose figures may be changed.

    Where it is that of a continuous plant behind a held stem, the changed one is so, too. Of
    others a longer dead time is a mean of whole ones, and their zeros stay.

    Attributes:
        own: as the model has it.
        figures: that may be off, gain and dead time first.
    """

    def __init__(self, own: ArxOutput) -> None:
        """Take the equation."""
        self.own = own
        denominator = (1.0, *own.a)
        plants = {valve: held(denominator, tuple(b)) for valve, b in own.b.items()}
        known = {valve: plant for valve, plant in plants.items() if plant is not None}
        self._plants = known if len(known) == len(plants) else {}
        self._poles = np.roots(denominator).astype(complex)
        whole = np.where(np.abs(self._poles) < ROUNDING, ROUNDING, self._poles)
        least = 1.0 / (1.0 + MOST[GAIN]) - 1.0
        shortest = -float(max(own.delay.values(), default=0))
        self.figures = [Figure(GAIN, least, MOST[GAIN]), Figure(DELAY, shortest, MOST[DELAY])]
        self.figures += _of_roots(np.log(whole), TIME_CONSTANT, None)
        for valve, plant in self._plants.items():
            self.figures += _of_roots(zeros_of(plant), LEAD, valve)

    def changed(self, values: FloatArray) -> ArxOutput:
        """Return the equation with its figures changed, shares and samples, shape (figures,).

        Its gain is changed by the first figure alone.
        """
        if not values.any():
            return self.own
        gain, late = 1.0 + float(values[0]), float(values[1])
        stretches = self._factors(values, TIME_CONSTANT, None, len(self._poles))
        if not self._plants:
            return self._of_means(gain, late, stretches)
        b, delays, poles = {}, {}, self._poles
        for valve, plant in self._plants.items():
            delay = self.own.delay[valve]
            led = self._factors(values, LEAD, valve, len(zeros_of(plant)))
            other, more = later(slower(plant, stretches, led), max(late, -float(delay)))
            poles = np.exp(other.poles)
            b[valve] = gain * other.sampled()
            delays[valve] = max(delay + more, 0)
        return self._with(np.real(np.poly(poles))[1:], b, delays)

    def lagged(self, lag: float, slow: str | None = None) -> ArxOutput | None:
        """Return the equation of the plant behind one more lag; None where no plant is known.

        Args:
            lag: time constant, samples.
            slow: the valve that it is of; None for the process and the sensor, which slow all.
        """
        poles, b = np.append(self._poles, math.exp(-1.0 / lag)), {}
        for valve, plant in self._plants.items():
            above = [1.0 / lag, 0.0] if slow in (None, valve) else [1.0 / lag, 1.0]
            numerator = np.convolve(plant.numerator, above)
            b[valve] = Held(np.append(plant.poles, -1.0 / lag), numerator, plant.fraction).sampled()
        return self._with(np.real(np.poly(poles))[1:], b, self.own.delay) if b else None

    def _factors(self, values: FloatArray, what: str, valve: str | None, count: int) -> FloatArray:
        factors = np.ones(count)
        for figure, value in zip(self.figures, values.tolist(), strict=True):
            if (figure.what, figure.valve) == (what, valve):
                factors[list(figure.roots)] = 1.0 + value
        return factors

    def _of_means(self, gain: float, late: float, stretches: FloatArray) -> ArxOutput:
        poles, moved = self._poles, stretches != 1.0
        slow = poles.copy()
        slow[moved] = np.exp(np.log(poles[moved]) / stretches[moved])
        level = float(np.real(np.prod((1.0 - slow[moved]) / (1.0 - poles[moved]))))
        b, delays = {}, {}
        for valve, taps in self.own.b.items():
            whole = math.floor(max(self.own.delay[valve] + late, 0.0))
            share = max(self.own.delay[valve] + late, 0.0) - whole
            b[valve] = gain * level * np.convolve(taps, [1.0 - share, share])
            delays[valve] = whole
        return self._with(np.real(np.atleast_1d(np.poly(slow)))[1:], b, delays)

    def _with(
        self, a: FloatArray, b: Mapping[str, FloatArray], delays: Mapping[str, int]
    ) -> ArxOutput:
        taps = {valve: tuple(each.tolist()) for valve, each in b.items()}
        return dataclasses.replace(self.own, a=tuple(a.tolist()), b=taps, delay=delays)


def _of_roots(roots: ComplexArray, what: str, valve: str | None) -> list[Figure]:
    """Return a figure for every root of G(s), in 1/sample, that lasts a sample, pairs as one."""
    found = []
    for k, root in enumerate(roots.tolist()):
        pace = abs(root)
        swings = abs(root.imag)
        if root.imag < -ROUNDING or not ROUNDING < pace <= 1.0:
            continue  # one of a pair stands for both
        pair: tuple[int, ...] = (k,)
        if swings > ROUNDING:
            pair = tuple(np.flatnonzero(np.abs(roots - root.conjugate()) < ROUNDING).tolist())
            pair = (k, *pair)
        found.append(
            Figure(what, min(NEGLIGIBLE * pace, 1.0) - 1.0, MOST[what], pair, valve, 1.0 / pace)
        )
    return found


def with_equation(process: Process, output: int, own: ArxOutput, sample_time: float) -> Process:
    """Return an ARX process with another equation of one output, behind its effects if any."""
    if isinstance(process, AlteredProcess):
        inner = with_equation(process.inner, output, own, sample_time)
        return AlteredProcess(inner, process.effects, sample_time)
    assert isinstance(process, ArxProcess)
    equations = (*process.equations[:output], own, *process.equations[output + 1 :])
    return ArxProcess(equations, process.valves, process.model.stem0, process.model.pv0)
