"""Laws of a noise beyond the declared one, by their states: what wanders, and where it enters."""

import dataclasses
import functools
import itertools
import math
from collections.abc import Callable

import numpy as np

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.declared_noise import DeclaredNoise, arx_equations
from stiction_ros.effects import Behaviour, ColouredDisturbance, FloatArray, RandomWalkDisturbance
from stiction_ros.signals.autoregression import companion
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

    one = np.ones((1, 1))

    def coloured(x: FloatArray) -> Block:
        keep, variance = math.exp(-step / math.exp(float(x[1]))), math.exp(2.0 * float(x[0]))
        return Block(keep * one, variance * (1.0 - keep**2) * one, np.ones(1), variance * one)

    def walk(x: FloatArray) -> Block:
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
        found.append(
            Law(
                f"load:{valve}",
                [np.log([ratio * unit / gain / math.sqrt(step)]) for ratio in (0.3, 3.0)],
                (np.array([least - math.log(gain)]), endless),
                functools.partial(_walk_through, a, b, c, step),
                walked,
            )
        )
    return found


def _walk_through(a: FloatArray, b: FloatArray, c: FloatArray, step: float, x: FloatArray) -> Block:
    """Return a random walk that enters a process, by the logarithm of its step."""
    count = len(a)
    whole, spread = np.zeros((count + 1, count + 1)), np.zeros((count + 1, count + 1))
    whole[:count, :count], whole[:count, count], whole[count, count] = a, b, 1.0
    spread[count, count] = math.exp(2.0 * float(x[0])) * step
    return Block(whole, spread, np.append(c, 0.0), np.zeros_like(whole))


def _path(base: Baseline, output: int, valve: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, b, c from a valve to an output; dead time delays a walk, which stays a walk."""
    process, name = base.run.model.process, base.run.model.valve_names[valve]
    equations = arx_equations(process)
    if equations is None:
        linear = process.linear(base.run.runs.sample_time)
        return linear.a, linear.b[:, valve], linear.c[output]
    equation = equations[output]
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
