"""Laws of a noise beyond the declared one, by their states: what wanders, and where it enters."""

import dataclasses
import itertools
import math
from collections.abc import Callable

import numpy as np
from scipy.linalg import block_diag

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.declared_noise import DeclaredNoise
from stiction_ros.discrepancy.likelihood.noise import SURPRISE, VANISHED, Blocks
from stiction_ros.discrepancy.likelihood.state_noise import innovations, left_by_columns
from stiction_ros.effects import Behaviour, ColouredDisturbance, FloatArray, RandomWalkDisturbance
from stiction_ros.effects.behaviour import BoolArray
from stiction_ros.processes import AlteredProcess, ArxProcess
from stiction_ros.signals.autoregression import TINY, companion
from stiction_ros.signals.state_space import responses

TIMES = (5.0, 30.0, 150.0)  # samples, of the first guesses of a coloured noise's memory
RATIOS = (0.03, 0.3)  # of a random walk's step to the declared noise, first guesses
SMALLEST = 1e-4  # of the declared noise, that is searched
FLOOR = 1e-6  # of the declared variance, that every measurement has


@dataclasses.dataclass(frozen=True)
class Block:
    """States of a noise."""

    a: FloatArray  # a, q: shape (n, n)
    q: FloatArray
    c: FloatArray  # what is seen of them, shape (n,)
    # their covariance at the first sample; what is left open of it is a free column
    start: FloatArray
    r: float = 0.0  # variance of a white part


@dataclasses.dataclass(frozen=True)
class Law:
    """A noise by the logarithms of its figures: its states beside those of the declared one.

    The first figure is a size. It has no upper bound: the declared noise may be nothing beside it.
    """

    place: str  # where it enters, as loop models name it
    starts: list[FloatArray]  # figures with which their search begins
    range: tuple[FloatArray, FloatArray]  # the lowest and the highest figures
    block: Callable[[FloatArray], Block]  # its states by its figures
    behaviour: Callable[[FloatArray], Behaviour]  # by its figures, too


def white_block(variance: float) -> Block:
    """Return noise without a memory."""
    nothing = np.zeros((0, 0))
    return Block(nothing, nothing, np.zeros(0), nothing, variance)


def laws_of(base: Baseline, output: int, declared: DeclaredNoise) -> list[Law]:
    """Return the laws that may tell an output's noise beyond the declared one.

    Args:
        base: the model with its effects.
        output: its index.
        declared: its noise.
    """
    model, step = base.run.model, base.run.runs.sample_time
    tag, unit = model.outputs[output], declared.std

    def coloured(x: FloatArray) -> Block:
        keep, variance = math.exp(-step / math.exp(float(x[1]))), math.exp(2.0 * float(x[0]))
        one = np.ones((1, 1))
        return Block(keep * one, variance * (1.0 - keep**2) * one, np.ones(1), variance * one)

    def walk(x: FloatArray) -> Block:
        one = np.ones((1, 1))
        return Block(one, math.exp(2.0 * float(x[0])) * step * one, np.ones(1), 0.0 * one)

    def walked(x: FloatArray) -> Behaviour:
        return RandomWalkDisturbance(math.exp(float(x[0])))

    spread = float(np.std(base.noise[output].residual[base.blocks[output].train]))
    size = max(spread, 2.0 * unit)
    lasts = float(base.run.runs.time.max())
    least, endless = math.log(SMALLEST * unit), np.full(1, math.inf)
    found = [
        Law(
            f"disturbance:{tag}",
            [np.log([size, time * step]) for time in TIMES],
            (np.array([least, math.log(0.5 * step)]), np.array([math.inf, math.log(lasts)])),
            coloured,
            lambda x: ColouredDisturbance(math.exp(float(x[0])), math.exp(float(x[1]))),
        ),
        Law(
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
        ) -> Block:
            count = len(a)
            whole, spread = np.zeros((count + 1, count + 1)), np.zeros((count + 1, count + 1))
            whole[:count, :count], whole[:count, count], whole[count, count] = a, b, 1.0
            spread[count, count] = math.exp(2.0 * float(x[0])) * step
            return Block(whole, spread, np.append(c, 0.0), np.zeros_like(whole))

        found.append(
            Law(
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
    ar, b = np.pad(-np.asarray(equation.a), (0, count - len(equation.a))), np.zeros(count)
    b[: len(own)] = own
    return companion(ar), b, np.eye(count)[0]


def _reach(a: FloatArray, b: FloatArray, c: FloatArray, rows: slice) -> float:
    """Return how far a step moves an output within a record, in the mean."""
    seen = responses(a, c[None], itertools.repeat(b[:, None], rows.stop - rows.start))
    return max(float(np.sqrt(np.mean(seen**2))), 1e-9)


def declared_block(base: Baseline, output: int, declared: DeclaredNoise) -> Block:
    """Return the declared noise, rounding in its white part; no states where it is white."""
    variance = declared.std**2
    rounding = base.run.runs.lattices[output] ** 2 / 12.0
    count = len(declared.ar)
    if not count:
        return white_block(variance + rounding)
    q = np.zeros((count, count))
    q[0, 0] = variance
    return Block(companion(declared.ar), q, np.eye(count)[0], q, FLOOR * variance + rounding)


CLOSE, FLAT, TURNS = 1e-2, 0.05, 60  # of the search: figures, their likelihood, turns


@dataclasses.dataclass(frozen=True)
class Shown:
    """What is judged: the gap and the columns that every fit projects out."""

    values: FloatArray  # shape (1 + q, N)
    seen: BoolArray  # rows that are measurements, shape (N,)
    begins: BoolArray  # first rows of records, shape (N,)


def shown_of(base: Baseline, output: int) -> Shown:
    """Return what is judged of an output of a model with its effects."""
    runs = base.run.runs
    values = np.column_stack([base.run.gap[:, output], base.columns[output]])
    begins = np.zeros(len(runs), dtype=bool)
    begins[[rows.start for rows in runs.slices]] = True
    return Shown(np.ascontiguousarray(values.T), runs.usable[output], begins)


def best_figures(law: Law, own: Block, shown: Shown, blocks: Blocks) -> tuple[FloatArray, float]:
    """Return the likeliest figures of a law, and −2 log likelihood of the fitted rows with them.

    Args:
        law: with the figures from which the search begins.
        own: states of the declared noise.
        shown: what is judged.
        blocks: its rows.
    """
    from scipy.optimize import minimize

    def loss(x: FloatArray) -> float:
        return score_of(x, law, own, shown, blocks)[0]

    options = {"xatol": CLOSE, "fatol": FLAT, "maxiter": TURNS}
    best, found = math.inf, law.starts[0]
    for start in law.starts:
        tried = minimize(loss, start, method="Nelder-Mead", options=options)
        if float(tried.fun) < best:
            best, found = float(tried.fun), np.asarray(tried.x)
    return found, best


def score_of(
    x: FloatArray, law: Law, own: Block, shown: Shown, blocks: Blocks
) -> tuple[float, float, float, float]:
    """Return −2 log likelihood of fitted and of held-out rows, and σ of the innovations.

    The ratio of the law to the declared noise is what counts: σ is left open as everywhere. The
    last is σ over that of the figures.
    """
    low, high = law.range
    if np.any(x < low) or np.any(x > high):
        return math.inf, 0.0, 0.0, 1.0
    block = law.block(x)
    unit = max(own.r, float(np.trace(own.q)), TINY)
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
    variance = max(float(inside @ inside) / len(inside), TINY)
    log = math.log(2.0 * math.pi * variance)
    outside = np.minimum(outside**2 / variance, SURPRISE**2)
    fitted = len(inside) * (log + 1.0) + float(logs[blocks.train].sum())
    kept_back = len(outside) * log + float(logs[blocks.held].sum()) + float(outside.sum())
    usual = float(np.median(variances[blocks.train]))
    return fitted, kept_back, math.sqrt(variance * usual), math.sqrt(variance / unit)
