"""Noise beyond the declared one, told as an effect: what wanders, how far, and where it enters."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.declared_noise import DeclaredNoise
from stiction_ros.discrepancy.likelihood.noise import (
    ENLARGED,
    SURPRISE,
    VANISHED,
    Blocks,
)
from stiction_ros.discrepancy.likelihood.state_noise import (
    innovations,
    left_by_columns,
    steady_gain,
)
from stiction_ros.effects import (
    Behaviour,
    ColouredDisturbance,
    FloatArray,
    RandomWalkDisturbance,
)
from stiction_ros.processes import AlteredProcess, ArxProcess

TIMES = (5.0, 30.0, 150.0)  # samples, of the first guesses of a coloured noise's memory
RATIOS = (0.03, 0.3)  # of a random walk's step to the declared noise, first guesses
SMALLEST, LARGEST = 1e-4, 100.0  # of the declared noise, and of what is left, that is searched
RECORDS = 10.0  # that a random walk remembers
SIDES = (-1.0, 1.0)
REJECTED = 8.0  # −2 log likelihood, above that of the best figures
SHORTEST_WAY = 1e-3
FLAT = 1e-3  # curvature of the likelihood over a logarithm, below which it has none
CLEAR = 0.3  # by which the logarithm of a figure has to be inside of its range
FLOOR = 1e-6  # of the declared variance, that every measurement has
NORMAL = 1.96
NO_LAW = 30.0  # BIC by which a law may miss an autoregression and still be its name
_TINY = 1e-300


@dataclasses.dataclass(frozen=True)
class NoiseEffect:
    """One law of a larger noise at its best.

    Attributes:
        place, behaviour: as loop models name them.
        intervals: 95 % of each figure.
        score: −2 log likelihood of fitted and held-out rows, and the price of its figures as
            of an effect.
        innovation_std: of what it leaves, units of the output.
    """

    place: str
    behaviour: Behaviour
    intervals: dict[str, tuple[float, float]]
    score: float
    innovation_std: float


@dataclasses.dataclass(frozen=True)
class _Law:
    """A noise by the logarithms of its figures: its states beside those of the declared one."""

    place: str
    starts: list[FloatArray]
    range: tuple[FloatArray, FloatArray]
    block: Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
    behaviour: Callable[[FloatArray], Behaviour]


def noise_effects(
    base: Baseline, output: int, declared: DeclaredNoise, least: float = 0.0
) -> list[NoiseEffect]:
    """Return the laws by which an output's noise may be larger than declared, the best first.

    Each law stands beside the declared noise in one state-space model, whose innovations are
    judged on the same rows as every other explanation.

    Args:
        base: the model with its effects.
        output: its index.
        declared: its noise.
        least: what a law has to gain a row in −2 log likelihood.

    Returns:
        The laws that beat the declared noise, with its rounding; the best first.
    """
    name = ("noise effects", output, declared.std, declared.ar.tobytes())
    if name not in base.known:
        laws = _laws(base, output, declared)
        base.known[name] = [_fitted(base, output, declared, law) for law in laws]
    found = base.known[name]
    enough = _without(base, output, declared) - least * int(base.blocks[output].train.sum())
    better = [each for each in found if each is not None and each.score < enough]
    lasts = float(base.run.runs.time.max())
    return sorted(_without_walks(better, lasts), key=lambda each: each.score)


def _without_walks(laws: list[NoiseEffect], lasts: float) -> list[NoiseEffect]:
    """Return laws without a coloured noise that may last as long as the record.

    Within the record that is a random walk, which has one figure less.
    """
    walks = [each.score for each in laws if isinstance(each.behaviour, RandomWalkDisturbance)]
    return [
        each
        for each in laws
        if not isinstance(each.behaviour, ColouredDisturbance)
        or each.intervals["tau"][1] < lasts * math.exp(-CLEAR)
        or each.score < min(walks, default=math.inf) - ENLARGED
    ]


def _without(base: Baseline, output: int, declared: DeclaredNoise) -> float:
    """Return the score of the declared noise alone, rounded values included."""
    none = _Law(
        "",
        [],
        (np.zeros(0), np.zeros(0)),
        lambda _: (np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0)),
        _nothing,
    )
    own, values = _declared_block(base, output, declared), _values(base, output)
    whole, held, *_ = _score(np.zeros(0), none, own, values, base.blocks[output])
    return whole + held


def _nothing(x: FloatArray) -> Behaviour:
    raise NotImplementedError("the declared noise is no effect")


def _values(base: Baseline, output: int) -> FloatArray:
    """Return the gap and the columns that every fit projects out, shape (1 + q, N)."""
    values = np.column_stack([base.run.gap[:, output], base.columns[output]])
    return np.ascontiguousarray(values.T)


def named_laws(found: Sequence[NoiseEffect], margin: float) -> tuple[NoiseEffect, ...]:
    """Return the best law and those that the record does not tell from it."""
    return tuple(each for each in found if each.score < found[0].score + margin)


def _laws(base: Baseline, output: int, declared: DeclaredNoise) -> list[_Law]:
    model, step = base.run.model, base.run.runs.sample_time
    tag, unit = model.outputs[output], declared.std

    def coloured(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        keep = math.exp(-step / math.exp(float(x[1])))
        spread = math.exp(2.0 * float(x[0])) * (1.0 - keep**2)
        return np.array([[keep]]), np.array([[spread]]), np.ones(1)

    def walk(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        return np.array([[stays]]), np.array([[math.exp(2.0 * float(x[0])) * step]]), np.ones(1)

    def walked(x: FloatArray) -> Behaviour:
        return RandomWalkDisturbance(math.exp(float(x[0])))

    spread = float(np.std(base.noise[output].residual[base.blocks[output].train]))
    size = max(spread, 2.0 * unit)
    lasts = float(base.run.runs.time.max())
    # Beside a process that integrates, a walk that forgets nothing could not be observed.
    stays = math.exp(-step / (RECORDS * lasts))
    walks = np.log([SMALLEST * unit]), np.log([max(spread, unit) / math.sqrt(step)])
    found = [
        _Law(
            f"disturbance:{tag}",
            [np.log([size, time * step]) for time in TIMES],
            (np.log([SMALLEST * unit, 0.5 * step]), np.log([LARGEST * size, lasts])),
            coloured,
            lambda x: ColouredDisturbance(math.exp(float(x[0])), math.exp(float(x[1]))),
        ),
        _Law(
            f"disturbance:{tag}",
            [np.log([ratio * unit / math.sqrt(step)]) for ratio in RATIOS],
            walks,
            walk,
            walked,
        ),
    ]
    for j, valve in enumerate(model.valve_names):
        if not base.run.responses.reaches(output, j):
            continue
        a, b, c = _path(base, output, j)
        gain = max(abs(float(base.run.model.process.linear(step).gain[output, j])), 1e-9)

        def through(
            x: FloatArray, a: FloatArray = a, b: FloatArray = b, c: FloatArray = c
        ) -> tuple[FloatArray, FloatArray, FloatArray]:
            count = len(a)
            whole = np.zeros((count + 1, count + 1))
            whole[:count, :count], whole[:count, count], whole[count, count] = a, b, stays
            spread = np.zeros_like(whole)
            spread[count, count] = math.exp(2.0 * float(x[0])) * step
            return whole, spread, np.append(c, 0.0)

        found.append(
            _Law(
                f"load:{valve}",
                [np.log([ratio * unit / gain / math.sqrt(step)]) for ratio in (0.3, 3.0)],
                (walks[0] - math.log(gain), walks[1] - math.log(gain) + math.log(LARGEST)),
                through,
                walked,
            )
        )
    return found


def _path(base: Baseline, output: int, valve: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, b, c from a valve to an output; dead time delays a walk, which stays a walk."""
    process, name = base.run.model.process, base.run.model.valve_names[valve]
    inner = process.inner if isinstance(process, AlteredProcess) else process
    if not isinstance(inner, ArxProcess):
        linear = process.linear(base.run.runs.sample_time)
        return linear.a, linear.b[:, valve], linear.c[output]
    equation = inner.equations[output]
    own = np.asarray(equation.b[name], dtype=float)
    count = max(len(equation.a), len(own))
    a, b = np.zeros((count, count)), np.zeros(count)
    a[: len(equation.a), 0] = -np.asarray(equation.a)
    a[:-1, 1:] += np.eye(count - 1)
    b[: len(own)] = own
    return a, b, np.eye(count)[0]


def _declared_block(
    base: Baseline, output: int, declared: DeclaredNoise
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return A, Q, c and R of the declared noise, rounding in R; no states where it is white."""
    variance = declared.std**2
    rounding = base.run.runs.lattices[output] ** 2 / 12.0
    count = len(declared.ar)
    if not count:
        return np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0), variance + rounding
    a, q = np.zeros((count, count)), np.zeros((count, count))
    a[:, 0] = declared.ar
    a[:-1, 1:] += np.eye(count - 1)
    q[0, 0] = variance
    return a, q, np.eye(count)[0], FLOOR * variance + rounding


def _fitted(base: Baseline, output: int, declared: DeclaredNoise, law: _Law) -> NoiseEffect | None:
    from scipy.optimize import minimize

    own, values = _declared_block(base, output, declared), _values(base, output)
    blocks = base.blocks[output]

    def loss(x: FloatArray) -> float:
        return _score(x, law, own, values, blocks)[0]

    best, found = math.inf, law.starts[0]
    for start in law.starts:
        tried = minimize(
            loss, start, method="Nelder-Mead", options={"xatol": 1e-2, "fatol": 0.05, "maxiter": 60}
        )
        if float(tried.fun) < best:
            best, found = float(tried.fun), np.asarray(tried.x)
    low, high = law.range
    if not math.isfinite(best) or np.any(found < low + CLEAR) or np.any(found > high - CLEAR):
        return None  # a figure on the bound of its range is no name
    whole, held, std, louder = _score(found, law, own, values, blocks)
    rows = max(int(blocks.train.sum()), 2)
    price = len(found) * math.log(rows) + ENLARGED
    first = np.eye(len(found))[0]  # is a size: σ is its unit
    behaviours = [law.behaviour(found + math.log(louder) * first)]
    for k, end in enumerate(_ends(loss, found, law.range)):
        scale = math.log(_score(end, law, own, values, blocks)[3])
        scale += SIDES[k % 2] * NORMAL / math.sqrt(2.0 * rows)
        behaviours.append(law.behaviour(end + scale * first))
    keys = [(p.key, p.attribute) for p in behaviours[0].parameters()]
    intervals = {
        key: (
            min(float(getattr(b, attribute)) for b in behaviours),
            max(float(getattr(b, attribute)) for b in behaviours),
        )
        for key, attribute in keys
    }
    return NoiseEffect(law.place, behaviours[0], intervals, whole + held + price, std)


def _ends(
    loss: Callable[[FloatArray], float], found: FloatArray, limits: tuple[FloatArray, FloatArray]
) -> list[FloatArray]:
    """Return points at both ends of each figure's 95 % by the curvature of the likelihood."""
    count, step = len(found), 0.1
    shifts = step * np.eye(count)
    centre = loss(found)
    bend = np.zeros((count, count))
    for i in range(count):
        for j in range(i, count):
            corner = loss(found + shifts[i] + shifts[j]) + loss(found - shifts[i] - shifts[j])
            other = loss(found + shifts[i] - shifts[j]) + loss(found - shifts[i] + shifts[j])
            bend[i, j] = bend[j, i] = (corner - other) / (4.0 * step**2)
        plus, minus = loss(found + shifts[i]), loss(found - shifts[i])
        bend[i, i] = (plus + minus - 2.0 * centre) / step**2
    if not np.isfinite(bend).all():
        return [np.array(limits[k]) for _ in found for k in range(2)]
    sizes, axes = np.linalg.eigh(0.5 * bend)
    spread = (axes / np.maximum(sizes, FLAT)) @ axes.T  # what does not bend is not known at all
    ways = NORMAL * spread / np.sqrt(np.diag(spread))  # each figure's end, the others at their best
    ends = []
    for way in ways.T:
        for side in SIDES:  # a valley may be bent: back to what the likelihood does not reject
            share = side
            while abs(share) > SHORTEST_WAY:
                end = np.clip(found + share * way, *limits)
                if loss(end) < centre + REJECTED:
                    break
                share *= 0.5
            ends.append(end)
    return ends


def _score(
    x: FloatArray,
    law: _Law,
    own: tuple[FloatArray, FloatArray, FloatArray, float],
    values: FloatArray,
    blocks: Blocks,
) -> tuple[float, float, float, float]:
    """Return −2 log likelihood of fitted and of held-out rows, and σ of the innovations.

    The ratio of the law to the declared noise is what counts: σ is left open as everywhere. The
    last is σ over that of the figures.
    """
    low, high = law.range
    if np.any(x < low) or np.any(x > high):
        return math.inf, 0.0, 0.0, 1.0
    a, q, c, r = own
    a2, q2, c2 = law.block(x)
    size, more = len(a), len(a2)
    whole, noise = np.zeros((size + more,) * 2), np.zeros((size + more,) * 2)
    whole[:size, :size], whole[size:, size:] = a, a2
    noise[:size, :size], noise[size:, size:] = q, q2
    look = np.concatenate([c, c2])
    unit = max(r, float(np.trace(q)), _TINY)
    steady = steady_gain(whole, noise / unit, look, max(r, FLOOR * unit) / unit)
    if steady is None:
        return math.inf, 0.0, 0.0, 1.0
    gain, foretold = steady
    kept = np.ascontiguousarray(whole - np.outer(gain, look))
    white = innovations(kept, gain, look, values)
    if not float(np.abs(white).max()) < 1e6 * float(np.abs(values).max()):
        return math.inf, 0.0, 0.0, 1.0
    left = left_by_columns(white, values, blocks.train, VANISHED)
    inside, outside = left[blocks.train], left[blocks.held]
    variance = max(float(inside @ inside) / len(inside), _TINY)
    log = math.log(2.0 * math.pi * variance)
    outside = np.minimum(outside**2 / variance, SURPRISE**2)
    fitted, kept_back = len(inside) * (log + 1.0), len(outside) * log + float(outside.sum())
    return fitted, kept_back, math.sqrt(variance), math.sqrt(variance / (unit * foretold))
