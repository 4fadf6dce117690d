"""Laws of a noise beyond the declared one, by their states: what wanders, and where it enters."""

import dataclasses
import itertools
import math

import numpy as np

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.declared_noise import DeclaredNoise, arx_equations
from stiction_ros.discrepancy.measures import TRACE
from stiction_ros.effects import Behaviour, ColouredDisturbance, FloatArray, RandomWalkDisturbance
from stiction_ros.signals.autoregression import companion
from stiction_ros.signals.state_space import responses

LARGEST = 10.0  # of what is left, that is searched

Path = tuple[FloatArray, FloatArray, FloatArray]  # A, b, c


@dataclasses.dataclass(frozen=True)
class Block:
    """States of a noise."""

    a: FloatArray  # a, q: shape (n, n)
    q: FloatArray
    c: FloatArray  # what is seen of them, shape (n,)
    r: float = 0.0  # variance of a white part


@dataclasses.dataclass(frozen=True)
class Law:
    """A noise by the logarithms of its figures, the first of which is a size.

    Far above the declared noise it may be any: σ, which is left open, is the unit of both.
    """

    place: str  # where it enters, as loop models name it
    kind: type[ColouredDisturbance] | type[RandomWalkDisturbance]  # what it is
    path: Path | None  # from there to the output; None where it is added to it
    range: tuple[FloatArray, FloatArray]  # the lowest and the highest figures
    sample_time: float  # s

    def behaviour(self, x: FloatArray) -> Behaviour:
        """Return it with its figures."""
        return self.kind(*np.exp(x).tolist())

    def block(self, x: FloatArray) -> Block:
        """Return its states: those of the path, and the noise itself as the last one."""
        size, *lasts = np.exp(x).tolist()
        keep = math.exp(-self.sample_time / lasts[0]) if lasts else 1.0
        a, b, c = self.path or (np.zeros((0, 0)), np.zeros(0), np.zeros(0))
        count = len(a)
        whole, driven = np.zeros((2, count + 1, count + 1))
        whole[:count, :count], whole[:count, count], whole[count, count] = a, b, keep
        driven[count, count] = size**2 * (1.0 - keep**2 if lasts else self.sample_time)
        return Block(whole, driven, np.append(c, 0.0 if self.path else 1.0))


def laws_of(base: Baseline, output: int, declared: DeclaredNoise) -> list[Law]:
    """Return the laws that may tell an output's noise beyond the declared one.

    Args:
        base: the model with its effects.
        output: its index.
        declared: its noise.
    """
    model, step = base.run.model, base.run.runs.sample_time
    left = float(np.std(base.noise[output].residual[base.blocks[output].train]))
    sizes = np.array([TRACE * declared.std, LARGEST * max(left, declared.std)])
    times = np.array([0.5 * step, float(base.run.runs.time.max())])
    added, walked = f"disturbance:{model.outputs[output]}", sizes / math.sqrt(step)
    coloured = np.log(np.column_stack([sizes, times]))
    found = [
        Law(added, ColouredDisturbance, None, (coloured[0], coloured[1]), step),
        Law(added, RandomWalkDisturbance, None, _ends(walked), step),
    ]
    for j, valve in enumerate(model.valve_names):
        if base.run.responses.reaches(output, j):
            path = _path(base, output, j)
            ends = _ends(walked / _reach(path, base.run.runs.longest))
            found.append(Law(f"load:{valve}", RandomWalkDisturbance, path, ends, step))
    return found


def _ends(sizes: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.log(sizes[:1]), np.log(sizes[1:])


def _path(base: Baseline, output: int, valve: int) -> Path:
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


def _reach(path: Path, rows: slice) -> float:
    """Return how far a step moves an output within a record, in the mean."""
    a, b, c = path
    seen = responses(a, c[None], itertools.repeat(b[:, None], rows.stop - rows.start))
    return max(float(np.sqrt(np.mean(seen**2))), 1e-9)


def declared_block(base: Baseline, output: int, declared: DeclaredNoise) -> Block:
    """Return the declared noise, rounding in its white part; no states where it is white."""
    variance = declared.std**2
    rounding = base.run.runs.lattices[output] ** 2 / 12.0
    count = len(declared.ar)
    q = np.zeros((count, count))
    if not count:
        return Block(q, q, np.zeros(0), variance + rounding)
    q[0, 0] = variance
    return Block(companion(declared.ar), q, np.eye(count)[0], TRACE * variance + rounding)
