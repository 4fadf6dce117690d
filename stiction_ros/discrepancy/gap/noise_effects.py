"""Noise beyond the declared one, told as an effect: what wanders, how far, and where it enters."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import block_diag

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.declared_noise import DeclaredNoise
from stiction_ros.discrepancy.likelihood.noise import (
    ENLARGED,
    SURPRISE,
    VANISHED,
    Blocks,
    BoolArray,
)
from stiction_ros.discrepancy.likelihood.state_noise import (
    innovations,
    left_by_columns,
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
SMALLEST = 1e-4  # of the declared noise, that is searched
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
class _Block:
    """States of a noise.

    Attributes:
        a, q: shape (n, n).
        c: what is seen of them, shape (n,).
        start: their covariance at the first sample; what is left open of it is a free column.
        r: variance of a white part.
    """

    a: FloatArray
    q: FloatArray
    c: FloatArray
    start: FloatArray
    r: float = 0.0


@dataclasses.dataclass(frozen=True)
class _Shown:
    """What is judged: the gap and the columns that every fit projects out.

    Attributes:
        values: shape (1 + q, N).
        seen: rows that are measurements, shape (N,).
        begins: first rows of records, shape (N,).
    """

    values: FloatArray
    seen: BoolArray
    begins: BoolArray


@dataclasses.dataclass(frozen=True)
class _Law:
    """A noise by the logarithms of its figures: its states beside those of the declared one.

    The first figure is a size. It has no upper bound: the declared noise may be nothing beside it.
    """

    place: str
    starts: list[FloatArray]
    range: tuple[FloatArray, FloatArray]
    block: Callable[[FloatArray], _Block]
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
    none = _Law("", [], (np.zeros(0), np.zeros(0)), lambda _: _white(0.0), _nothing)
    own, shown = _declared_block(base, output, declared), _shown(base, output)
    whole, held, *_ = _score(np.zeros(0), none, own, shown, base.blocks[output])
    return whole + held


def _nothing(x: FloatArray) -> Behaviour:
    raise NotImplementedError("the declared noise is no effect")


def _white(variance: float) -> _Block:
    nothing = np.zeros((0, 0))
    return _Block(nothing, nothing, np.zeros(0), nothing, variance)


def _shown(base: Baseline, output: int) -> _Shown:
    runs = base.run.runs
    values = np.column_stack([base.run.gap[:, output], base.columns[output]])
    begins = np.zeros(len(runs), dtype=bool)
    begins[[rows.start for rows in runs.slices]] = True
    return _Shown(np.ascontiguousarray(values.T), runs.usable[output], begins)


def named_laws(found: Sequence[NoiseEffect], margin: float) -> tuple[NoiseEffect, ...]:
    """Return the best law and those that the record does not tell from it."""
    return tuple(each for each in found if each.score < found[0].score + margin)


def _laws(base: Baseline, output: int, declared: DeclaredNoise) -> list[_Law]:
    model, step = base.run.model, base.run.runs.sample_time
    tag, unit = model.outputs[output], declared.std

    def coloured(x: FloatArray) -> _Block:
        keep, variance = math.exp(-step / math.exp(float(x[1]))), math.exp(2.0 * float(x[0]))
        one = np.ones((1, 1))
        return _Block(keep * one, variance * (1.0 - keep**2) * one, np.ones(1), variance * one)

    def walk(x: FloatArray) -> _Block:
        one = np.ones((1, 1))
        return _Block(one, math.exp(2.0 * float(x[0])) * step * one, np.ones(1), 0.0 * one)

    def walked(x: FloatArray) -> Behaviour:
        return RandomWalkDisturbance(math.exp(float(x[0])))

    spread = float(np.std(base.noise[output].residual[base.blocks[output].train]))
    size = max(spread, 2.0 * unit)
    lasts = float(base.run.runs.time.max())
    least, endless = math.log(SMALLEST * unit), np.full(1, math.inf)
    found = [
        _Law(
            f"disturbance:{tag}",
            [np.log([size, time * step]) for time in TIMES],
            (np.array([least, math.log(0.5 * step)]), np.array([math.inf, math.log(lasts)])),
            coloured,
            lambda x: ColouredDisturbance(math.exp(float(x[0])), math.exp(float(x[1]))),
        ),
        _Law(
            f"disturbance:{tag}",
            [np.log([ratio * unit / math.sqrt(step)]) for ratio in RATIOS],
            (np.array([least]), endless),
            walk,
            walked,
        ),
    ]
    for j, valve in enumerate(model.valve_names):
        if not base.run.responses.reaches(output, j):
            continue
        a, b, c = _path(base, output, j)
        gain = _reach(a, b, c, base.run.runs.longest)

        def through(
            x: FloatArray, a: FloatArray = a, b: FloatArray = b, c: FloatArray = c
        ) -> _Block:
            count = len(a)
            whole, spread = np.zeros((count + 1, count + 1)), np.zeros((count + 1, count + 1))
            whole[:count, :count], whole[:count, count], whole[count, count] = a, b, 1.0
            spread[count, count] = math.exp(2.0 * float(x[0])) * step
            return _Block(whole, spread, np.append(c, 0.0), np.zeros_like(whole))

        found.append(
            _Law(
                f"load:{valve}",
                [np.log([ratio * unit / gain / math.sqrt(step)]) for ratio in (0.3, 3.0)],
                (np.array([least - math.log(gain)]), endless),
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


def _reach(a: FloatArray, b: FloatArray, c: FloatArray, rows: slice) -> float:
    """Return how far a step moves an output within a record, in the mean."""
    state, seen = np.zeros(len(a)), np.empty(rows.stop - rows.start)
    for k in range(len(seen)):
        seen[k] = c @ state
        state = a @ state + b
    return max(float(np.sqrt(np.mean(seen**2))), 1e-9)


def _declared_block(base: Baseline, output: int, declared: DeclaredNoise) -> _Block:
    """Return the declared noise, rounding in its white part; no states where it is white."""
    variance = declared.std**2
    rounding = base.run.runs.lattices[output] ** 2 / 12.0
    count = len(declared.ar)
    if not count:
        return _white(variance + rounding)
    a, q = np.zeros((count, count)), np.zeros((count, count))
    a[:, 0] = declared.ar
    a[:-1, 1:] += np.eye(count - 1)
    q[0, 0] = variance
    return _Block(a, q, np.eye(count)[0], q, FLOOR * variance + rounding)


def _fitted(base: Baseline, output: int, declared: DeclaredNoise, law: _Law) -> NoiseEffect | None:
    from scipy.optimize import minimize

    own, shown = _declared_block(base, output, declared), _shown(base, output)
    blocks = base.blocks[output]

    def loss(x: FloatArray) -> float:
        return _score(x, law, own, shown, blocks)[0]

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
    whole, held, std, louder = _score(found, law, own, shown, blocks)
    rows = max(int(blocks.train.sum()), 2)
    price = len(found) * math.log(rows) + ENLARGED
    first = np.eye(len(found))[0]  # is a size: σ is its unit
    behaviours = [law.behaviour(found + math.log(louder) * first)]
    ends = _ends(loss, found, law.range)
    if not np.isfinite(ends).all():
        return None  # an interval that holds nothing out is no name
    for k, end in enumerate(ends):
        scale = math.log(_score(end, law, own, shown, blocks)[3])
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
    x: FloatArray, law: _Law, own: _Block, shown: _Shown, blocks: Blocks
) -> tuple[float, float, float, float]:
    """Return −2 log likelihood of fitted and of held-out rows, and σ of the innovations.

    The ratio of the law to the declared noise is what counts: σ is left open as everywhere. The
    last is σ over that of the figures.
    """
    low, high = law.range
    if np.any(x < low) or np.any(x > high):
        return math.inf, 0.0, 0.0, 1.0
    block = law.block(x)
    unit = max(own.r, float(np.trace(own.q)), _TINY)
    white, variances = innovations(
        block_diag(own.a, block.a),
        block_diag(own.q, block.q) / unit,
        np.concatenate([own.c, block.c]),
        max(own.r, FLOOR * unit) / unit,
        block_diag(own.start, block.start) / unit,
        shown.values,
        shown.seen,
        shown.begins,
    )
    if not np.isfinite(white).all():
        return math.inf, 0.0, 0.0, 1.0
    left, logs = left_by_columns(white, shown.values, blocks.train, VANISHED), np.log(variances)
    inside, outside = left[blocks.train], left[blocks.held]
    variance = max(float(inside @ inside) / len(inside), _TINY)
    log = math.log(2.0 * math.pi * variance)
    outside = np.minimum(outside**2 / variance, SURPRISE**2)
    fitted = len(inside) * (log + 1.0) + float(logs[blocks.train].sum())
    kept_back = len(outside) * log + float(logs[blocks.held].sum()) + float(outside.sum())
    usual = float(np.median(variances[blocks.train]))
    return fitted, kept_back, math.sqrt(variance * usual), math.sqrt(variance / unit)
