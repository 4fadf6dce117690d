"""What somebody could say of a loop who knows plant and noise and what can be hidden.

The true effect, and every other one of the catalogue, is fitted at its place by maximum
likelihood over all rows, in the simulation that made the loop, under the recorded OP.
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.signal import lfilter

from stiction_studies.field import loads
from stiction_studies.field.hidden.effect import (
    BY_CONTROLLER,
    BY_VALUES,
    LOAD,
    OUTPUT,
    PERIODIC,
    PROCESS,
    RANDOM,
    SENSOR,
    VALVE,
    Effect,
    Name,
)
from stiction_studies.field.hidden.hidden_loop import HiddenLoop
from stiction_studies.field.hidden.likelihood import Likelihood, random_form, true_form
from stiction_studies.field.hidden.plants import FINE
from stiction_studies.field.hidden.simulation import AT_REST, LEAD, Signals, run
from stiction_studies.field.kernels import FloatArray

DIGIT = math.log(10.0)
"""Gain of a value that stands where only one in ten would stand by chance."""

STARTS = 2  # best points of a grid that a fit goes on from
STEPS = 70  # of a fit from each
ONSETS = 4  # samples between two moments at which a step may begin
PEAKS = 6  # of a spectrum, at which square and triangle waves are tried
PHASES = 24
WAVES = 3.0  # periods in a record, at least: with fewer a square is a step
SHORTEST = 8.0  # samples of a period
LONGER = (10.0, 30.0, 100.0)  # memories of a coloured noise that is nearly a random walk
TURN = 2.0 * math.pi


@dataclasses.dataclass(frozen=True)
class Gain:
    """What the oracle gains in ln L by one hidden effect."""

    effect: Name  # place and name
    over_none: float  # over no effect
    over_rival: float  # over the best effect outside its family
    rival: Name  # place and name of that

    def to_mapping(self) -> dict[str, Any]:
        """Return the JSON mapping."""
        return {
            "place": self.effect[0],
            "effect": self.effect[1],
            "none": self.over_none,
            "rival": self.over_rival,
            "best_rival": " ".join(self.rival),
        }


def oracle(loop: HiddenLoop) -> tuple[Gain, ...]:
    """Return what is gained by each hidden effect, with the other one where there are two."""
    return tuple(_gain(loop, effect) for effect in loop.hidden)


def family(loop: HiddenLoop, effect: Effect) -> frozenset[Name]:
    """Return the effects that no record of this loop tells from one that is hidden.

    - A step of the load: an offset of the valve. Sines of load and output.
    - Lags of valve, process and sensor, the valve's not where the stem is recorded; a step of
      output and sensor.
    - Drifts of load, output and sensor, where the plant settles.
    - Stiction, where there is backlash: with a jump of nothing it is the same. Backlash, where
      friction is that of a stem's mechanics.
    - A longer dead time and a shifted clock, where no OP can be recomputed.
    """
    key = effect.key
    groups = [
        {(LOAD, "step"), (VALVE, "offset")},
        {(LOAD, "sine"), (OUTPUT, "sine")},
        {(PROCESS, "pole"), (SENSOR, "lag")}
        | (set() if loop.surroundings.stem_recorded else {(VALVE, "lag")}),
        {(OUTPUT, "step"), (SENSOR, "bias_step")},
        {(OUTPUT, "drift"), (SENSOR, "drift")}
        | (set() if loop.base.plant.integrating else {(LOAD, "drift")}),
    ]
    if effect.mechanical or effect.name == "backlash":
        groups.append({(VALVE, "stiction"), (VALVE, "backlash")})
    s = loop.surroundings
    if not (s.closed and s.set_point_kept and s.scan == 1.0 and s.keeping == "as_read"):
        groups.append({(PROCESS, "delay"), ("data", "time_shift")})
    return frozenset({key}.union(*(group for group in groups if key in group)))


def _gain(loop: HiddenLoop, effect: Effect) -> Gain:
    nothing = ("", "none")
    if effect.name in BY_VALUES + BY_CONTROLLER:
        shown = DIGIT * _rows_shown(loop, effect)
        return Gain(effect.key, shown, shown, nothing)
    fits = Fits(loop, tuple(other for other in loop.hidden if other is not effect))
    own = fits.truth(effect)
    alike = family(loop, effect)
    rivals = {nothing: fits.none}
    for key, value in fits.rivals():
        if key not in alike:
            rivals[key] = max(value, rivals.get(key, -math.inf))
    best = max(rivals, key=lambda key: rivals[key])
    return Gain(effect.key, own - fits.none, own - rivals[best], best)


def _rows_shown(loop: HiddenLoop, effect: Effect) -> int:
    """Return at how many rows an effect of values or controller shows by itself."""
    pv = loop.record.pv[:, 0]
    if effect.name == "freeze":
        return round(effect.figures["duration"] / loop.record.sample_time)
    if effect.name == "clip":
        ends = [effect.figures[key] for key in ("low", "high")]
        return int(np.isclose(pv[:, None], ends).any(axis=1).sum())
    return len(pv)


class Fits:
    """Explanations of one record, each with the other hidden effects at their true figures."""

    def __init__(self, loop: HiddenLoop, others: tuple[Effect, ...]) -> None:
        self.loop, self.others = loop, others
        self.plant, self.sample_time = loop.base.plant, loop.base.sample_time
        zeros = np.zeros(len(loop.op))
        self.signals = Signals(np.full(len(loop.op), AT_REST), zeros, zeros, loop.op)
        self.pv = loop.record.pv[:, 0]
        self.count = len(self.pv)
        self.op = loop.op[LEAD:]
        a, _, c = self.plant.stepped(loop.record.sample_time)
        free = [np.ones(self.count)]
        for state in np.eye(len(c)):
            column = np.empty(self.count)
            for k in range(self.count):
                column[k] = c @ state
                state = a @ state
            free.append(column)
        if self.plant.integrating:  # nobody knows the OP at which a level stands, or stood, still
            free.append(self._behind(np.ones((LEAD + self.count, 1)))[LEAD:, 0])
        self.free = np.column_stack(free)
        form = true_form(loop.noise, self.plant, loop.record.sample_time, loop.kept)
        self.form = form
        self.likelihood = Likelihood(form, self.free, loop.plain)
        self.simulated = self._simulated(())
        self.left = self.pv - self.simulated
        self.none = self.likelihood.of(self.left)

    def _simulated(self, effects: tuple[Effect, ...]) -> FloatArray:
        every = self.loop.every
        out = run(self.loop.base, self.signals, (*self.others, *effects)).pv
        return np.asarray(out[LEAD::every][: self.count])

    def _score(self, effect: Effect) -> float:
        return self.likelihood.of(self.pv - self._simulated((effect,)))

    def truth(self, effect: Effect) -> float:
        """Return ln L of the true effect, its figures fitted from the true ones."""
        if effect.name in RANDOM:
            return self._random(effect)
        moved = [key for key in effect.figures if key not in ("natural", "damping", "lag")]
        moved = [key for key in moved if key not in (*effect.untold, "stribeck")]
        if effect.law in ("quadratic", "in a line"):
            moved = ["curve"]
        true = np.array([effect.figures[key] for key in moved])
        size = np.maximum(np.abs(true), 1e-6)
        size[[key == "phase" for key in moved]] = 1.0

        def loss(x: FloatArray) -> float:
            figures = dict(effect.figures) | dict(zip(moved, true + x * size, strict=True))
            trial = dataclasses.replace(effect, figures=figures)
            return -self._score(trial) if _allowed(trial) else math.inf

        begun = loss(np.zeros(len(true)))
        simplex = np.vstack([np.zeros(len(true)), 0.02 * np.eye(len(true))])
        found = minimize(
            loss,
            np.zeros(len(true)),
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": 2 * STEPS},
        )
        return -min(begun, float(found.fun))

    def _random(self, effect: Effect, longer: tuple[float, ...] = ()) -> float:
        """Return ln L with noise of another form beside, its size and memory fitted.

        Args:
            effect: about as it may be.
            longer: further factors of its memory.
        """
        sample_time = self.loop.record.sample_time
        sizes = np.geomspace(0.1, 10.0, 7)
        times: tuple[float, ...] = (0.3, 1.0, 3.0) if effect.name == "coloured" else (1.0,)
        times = (*times, *longer)

        def score(size: float, time: float) -> float:
            figures = {"rate": size * effect.figures.get("rate", 0.0)}
            if effect.name == "coloured":
                figures = {"std": size * effect.figures["std"], "tau": time * effect.figures["tau"]}
            other = random_form(
                dataclasses.replace(effect, figures=figures), self.plant, sample_time
            )
            return Likelihood(self.form.beside(other), self.free, self.loop.plain).of(self.left)

        return max(score(float(size), time) for size in sizes for time in times)

    def rivals(self) -> Iterator[tuple[Name, float]]:
        """Yield ln L of every effect that is fitted."""
        for key, grid, make in self._searched():
            yield key, self._best(grid, make)
        column = (self.simulated - AT_REST)[:, None]
        yield (PROCESS, "gain"), float(self._with(column, 1)[0])
        yield from self._steps()
        time = np.arange(self.count, dtype=np.float64)
        yield (OUTPUT, "drift"), float(self._with(time[:, None], 1)[0])
        yield (LOAD, "drift"), float(self._with(self._behind(time[:, None]), 1)[0])
        yield from self._waves()
        unit = self.loop.unit
        for place, size in ((OUTPUT, unit), (LOAD, 1.0)):
            rate = 4.0 / math.sqrt(self.count * self.loop.record.sample_time) * size
            yield (place, "random_walk"), self._random(Effect(place, "random_walk", {"rate": rate}))
        figures = {"std": 0.8 * unit, "tau": 15.0 * self.loop.record.sample_time}
        rival = Effect(OUTPUT, "coloured", figures)
        yield (OUTPUT, "coloured"), self._random(rival, LONGER)

    def _searched(self) -> Iterator[tuple[Name, FloatArray, Callable[[FloatArray], Effect]]]:
        """Yield effects whose figures are searched: their grids, and what makes them of a row."""
        moves = max(float(np.quantile(np.abs(self.op[5:] - self.op[:-5]), 0.995)), 0.2)
        taus = np.geomspace(0.3, 60.0, 12) * self.sample_time
        levels = np.quantile(self.op, np.linspace(0.02, 0.98, 17))
        sums, shares = np.geomspace(0.7, 16.0, 12), np.linspace(0.0, 0.85, 5)
        both = np.array([(a, b) for a in sums for b in shares])

        def one(place: str, name: str, key: str) -> Callable[[FloatArray], Effect]:
            return lambda row: Effect(place, name, {key: float(row[0])})

        def he(row: FloatArray) -> Effect:
            static = float(row[0] / (1.0 + row[1]))
            return Effect(VALVE, "stiction", {"f_s": static, "f_d": float(row[1]) * static})

        def end(key: str) -> Callable[[FloatArray], Effect]:
            ends = {"low": -1e6, "high": 1e6}
            return lambda row: Effect(VALVE, "saturation", ends | {key: float(row[0])})

        yield (VALVE, "stiction"), both, he
        yield (VALVE, "backlash"), sums[:, None], one(VALVE, "backlash", "band")
        rates = moves / np.geomspace(2.0, 60.0, 12) / self.sample_time
        yield (VALVE, "slew"), rates[:, None], one(VALVE, "slew", "rate")
        yield (VALVE, "lag"), taus[:, None], one(VALVE, "lag", "tau")
        yield (VALVE, "saturation"), levels[:, None], end("high")
        yield (VALVE, "saturation"), levels[:, None], end("low")
        curves = np.array([-4.0, -2.5, -1.5, -0.7, -0.3, 0.3, 0.7, 1.5, 2.5, 4.0])
        yield (VALVE, "characteristic"), curves[:, None], one(VALVE, "characteristic", "curve")
        extras = np.concatenate([np.linspace(0.5, 6.0, 12), np.linspace(7.0, 16.0, 10)])
        yield (PROCESS, "delay"), extras[:, None], one(PROCESS, "delay", "extra")
        if self.plant.integrating:
            rates = 1.0 / (np.geomspace(10.0, 500.0, 8) * self.sample_time)
            yield (PROCESS, "leak"), rates[:, None], one(PROCESS, "leak", "rate")

    def _best(self, grid: FloatArray, make: Callable[[FloatArray], Effect]) -> float:
        """Return ln L of the best figures, from the best points of a grid on."""

        @functools.cache
        def scored(row: tuple[float, ...]) -> float:
            effect = make(np.array(row))
            return self._score(effect) if _allowed(effect) else -math.inf

        scores = np.array([scored(tuple(row)) for row in grid])
        best = float(scores.max())
        for start in grid[np.argsort(scores)[::-1][:STARTS]]:
            size = np.maximum(0.1 * np.abs(start), 1e-3)
            found = minimize(
                lambda x: -scored(tuple(x)),
                start,
                method="Nelder-Mead",
                options={
                    "initial_simplex": np.vstack([start, start + np.diag(size)]),
                    "maxfev": STEPS,
                    "fatol": 0.05,
                },
            )
            best = max(best, -float(found.fun))
        return best

    def _with(self, columns: FloatArray, each: int) -> FloatArray:
        return self.likelihood.with_columns(self.left, columns, each)

    def _behind(self, columns: FloatArray) -> FloatArray:
        """Return what the plant makes of loads that are held for a sample, same shape."""
        a, b, delay = self.plant.sampled(self.loop.record.sample_time, FINE * self.loop.every)
        return np.asarray(lfilter([*np.zeros(delay + 1), *b], [1.0, *a], columns, axis=0))

    def _steps(self) -> Iterator[tuple[Name, float]]:
        rows = np.arange(self.count)[:, None]
        for place, through in ((OUTPUT, lambda x: x), (LOAD, self._behind)):
            onsets = np.arange(ONSETS, self.count - ONSETS, ONSETS)
            scores = self._with(through((rows >= onsets).astype(np.float64)), 1)
            near = onsets[int(np.argmax(scores))] + np.arange(-ONSETS, ONSETS + 1)
            finer = self._with(through((rows >= near).astype(np.float64)), 1)
            yield (place, "step"), float(max(scores.max(), finer.max()))

    def _waves(self) -> Iterator[tuple[Name, float]]:
        time = np.arange(self.count, dtype=np.float64)
        least, most = WAVES, 2.0 * self.count / SHORTEST
        pace = np.arange(2.0 * least, most) / (2.0 * self.count)
        scores = self._with(_circles(time, pace), 2)
        top = pace[np.argsort(scores)[::-1][:PEAKS]]
        finer = (top[:, None] + np.linspace(-0.5, 0.5, 9) / (2.0 * self.count)).ravel()
        finer = finer[finer > 0.0]
        yield (OUTPUT, "sine"), float(max(scores.max(), self._with(_circles(time, finer), 2).max()))
        for name in PERIODIC[1:]:
            shape = loads.Wave(name)
            columns = np.column_stack(
                [
                    loads.wave(shape, time, 1.0 / p, phase)
                    for p in finer
                    for phase in np.arange(PHASES) / (2.0 * PHASES)
                ]
            )
            yield (OUTPUT, name), float(self._with(columns, 1).max())
            yield (LOAD, name), float(self._with(self._behind(columns), 1).max())


def _circles(time: FloatArray, pace: FloatArray) -> FloatArray:
    """Return cosine and sine of each frequency in turn, shape (N, 2 F)."""
    angle = TURN * time[:, None] * pace
    return np.stack([np.cos(angle), np.sin(angle)], axis=2).reshape(len(time), -1)


def _allowed(effect: Effect) -> bool:
    """Tell whether figures are such as an effect has."""
    figures, signed = effect.figures, ("curve", "size", "phase", "time", "low", "high")
    for key, value in figures.items():
        free = key in signed or effect.name == "drift"
        if not math.isfinite(value) or (value < 0.0 and not free):
            return False
    if figures.get("f_d", 0.0) > figures.get("f_s", math.inf):
        return False
    if effect.law == "in a line" and figures["curve"] >= 1.0:
        return False
    if figures.get("sliding", 0.0) > figures.get("static", math.inf):
        return False
    return 0.0 <= figures.get("extra", 0.0) < 60.0 and figures.get("period", 1.0) > 0.0
