"""One output's ARX equation fitted in free run, behind stems that are given."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.deferred import lfilter
from stiction_ros.discrepancy.likelihood.noise import Blocks, NoiseFit, fit_noise
from stiction_ros.discrepancy.simulation.free_run import Runs
from stiction_ros.effects import FloatArray
from stiction_ros.signals.autoregression import whiten
from stiction_ros.signals.polynomials import largest_root, stabilised

RADIUS = 0.9995
LARGEST_START = 0.995
PREFILTERINGS = 3
LEAST_GAIN = 0.1
SHARES = (1.0, 0.4, 0.1)  # of a Gauss-Newton step


@dataclasses.dataclass(frozen=True)
class Equation:
    """Coefficients of one output: a (n_a,), and per valve b and delay."""

    a: FloatArray
    b: tuple[FloatArray, ...]
    delay: tuple[int, ...]

    @property
    def denominator(self) -> FloatArray:
        """A as a polynomial in powers of q⁻¹, shape (n_a + 1,)."""
        return np.concatenate([[1.0], self.a])

    @property
    def stable(self) -> bool:
        """Whether all poles lie well inside the unit circle."""
        return largest_root(self.denominator) < RADIUS

    def moved(self, step: FloatArray) -> "Equation":
        """Return the equation with a step in (a, b of each valve) added."""
        first, parts = len(self.a), []
        for b in self.b:
            parts.append(b + step[first : first + len(b)])
            first += len(b)
        return dataclasses.replace(self, a=self.a + step[: len(self.a)], b=tuple(parts))

    def at(self, delay: Sequence[int]) -> "Equation":
        """Return the equation with other delays."""
        return dataclasses.replace(self, delay=tuple(delay))


@dataclasses.dataclass(frozen=True)
class Fitted:
    """An equation and the noise that it leaves on the fitted rows."""

    noise: NoiseFit
    equation: Equation

    @property
    def bic(self) -> float:
        """BIC without the price of the equation, which all rivals of its orders share."""
        return self.noise.bic(0)


@dataclasses.dataclass(frozen=True)
class Problem:
    """One output and the stems that drive it."""

    y: FloatArray  # PV less what disturbances and sensors add, shape (N,)
    stems: FloatArray  # shape (N, m), %
    runs: Runs  # the records end to end
    blocks: Blocks  # rows that are fitted, rows that are kept back

    def each(
        self, values: FloatArray, numerator: FloatArray, denominator: FloatArray
    ) -> FloatArray:
        """Return a filter's output, started anew in every record."""
        parts = [lfilter(numerator, denominator, values[rows], axis=0) for rows in self.runs.slices]
        return np.concatenate(parts)

    def inputs(self, equation: Equation) -> list[FloatArray]:
        """Return per valve the delayed stems, in deviations from the first, one column per b."""
        found = []
        for j, b in enumerate(equation.b):
            columns = np.zeros((len(self.y), len(b)))
            for rows in self.runs.slices:
                stem = self.stems[rows, j] - self.stems[rows.start, j]
                for k in range(len(b)):
                    late = 1 + equation.delay[j] + k
                    columns[rows.start + late : rows.stop, k] = stem[: max(len(stem) - late, 0)]
            found.append(columns)
        return found

    def constants(self) -> FloatArray:
        """Return one column per record that is 1 in it, shape (N, R)."""
        columns = np.zeros((len(self.y), len(self.runs.slices)))
        for r, rows in enumerate(self.runs.slices):
            columns[rows, r] = 1.0
        return columns

    def impulses(self, count: int) -> FloatArray:
        """Return impulses at the first ``count`` samples of every record."""
        columns = np.zeros((len(self.y), count * len(self.runs.slices)))
        for r, rows in enumerate(self.runs.slices):
            for k in range(count):
                columns[rows.start + k, r * count + k] = 1.0
        return columns

    def free(self, equation: Equation) -> FloatArray:
        """Return the responses to the past and to a constant of every record."""
        columns = np.hstack([self.impulses(len(equation.a)), self.constants()])
        return self.each(columns, np.ones(1), equation.denominator)

    def forced(self, equation: Equation) -> FloatArray:
        """Return the response to the stems, shape (N,)."""
        total = sum(c @ b for c, b in zip(self.inputs(equation), equation.b, strict=True))
        return self.each(np.asarray(total), np.ones(1), equation.denominator)

    def fit(self, equation: Equation, like: FloatArray | None = None) -> Fitted:
        """Return the noise behind an equation; ``like`` is φ to begin with."""
        gap = self.y - self.forced(equation)
        return Fitted(fit_noise(gap, self.free(equation), self.blocks, like), equation)

    def sensitivities(self, equation: Equation, output: FloatArray) -> FloatArray:
        """Return the derivatives of the free run with respect to (a, b), shape (N, n_a + Σ n_b)."""
        columns = []
        for k in range(1, len(equation.a) + 1):
            columns.append(-self.late(output, k)[:, None])
        columns += self.inputs(equation)
        return self.each(np.hstack(columns), np.ones(1), equation.denominator)

    def late(self, values: FloatArray, count: int) -> FloatArray:
        """Return values of ``count`` samples before, 0 at the start of every record."""
        out = np.zeros_like(values)
        for rows in self.runs.slices:
            out[rows.start + count : rows.stop] = values[rows.start : rows.stop - count]
        return out


def best_fit(problem: Problem, starts: Sequence[Equation], rounds: int) -> Fitted | None:
    """Return the best equation by Gauss-Newton from the best of several starts.

    The likelihood is that of the innovations on the fitted rows. None where no start is stable.
    """
    fitted = [problem.fit(start) for start in starts if start.stable]
    if not fitted:
        return None
    best = min(fitted, key=lambda each: each.bic)
    for _ in range(rounds):
        improved = _line_search(problem, best, _step(problem, best))
        if improved is None:
            break
        gain = best.bic - improved.bic
        best = improved
        if gain < LEAST_GAIN:
            break
    return best


def _step(problem: Problem, now: Fitted) -> tuple[FloatArray, FloatArray]:
    """Return the Gauss-Newton steps in (a, b) and φ, the free columns solved for beside them."""
    ar, residual, rows = now.noise.ar, now.noise.residual, problem.blocks.train
    driven = problem.sensitivities(now.equation, problem.y - residual)
    columns = whiten(np.hstack([driven, problem.free(now.equation)]), ar)
    late = [problem.late(residual, k)[:, None] for k in range(1, len(ar) + 1)]
    inner = np.hstack([columns, *late])[rows]
    scale = np.maximum(np.linalg.norm(inner, axis=0), 1e-300)
    target = whiten(residual, ar)[rows]
    step = np.linalg.lstsq(inner / scale, target, rcond=1e-9)[0] / scale
    return step[: driven.shape[1]], step[len(step) - len(ar) :]


def _line_search(
    problem: Problem, now: Fitted, steps: tuple[FloatArray, FloatArray]
) -> Fitted | None:
    for share in SHARES:
        tried = now.equation.moved(share * steps[0])
        if not tried.stable:
            continue
        found = problem.fit(tried, now.noise.ar + share * steps[1])
        if found.bic < now.bic:
            return found
    return None


def filtered_fits(problem: Problem, own: Equation) -> list[Equation]:
    """Return equation-error fits, the data filtered by 1/A of the fit before."""
    found: list[Equation] = []
    denominator = np.ones(1)
    rows = problem.blocks.train
    zero = dataclasses.replace(
        own, a=np.zeros_like(own.a), b=tuple(np.zeros_like(b) for b in own.b)
    )
    inputs = problem.inputs(own)
    for _ in range(PREFILTERINGS):
        y = problem.each(problem.y, np.ones(1), denominator)
        columns = [-problem.late(y, k)[:, None] for k in range(1, len(own.a) + 1)]
        columns += [problem.each(c, np.ones(1), denominator) for c in inputs]
        count = sum(c.shape[1] for c in columns)
        columns.append(problem.each(problem.constants(), np.ones(1), denominator))
        whole = np.hstack(columns)[rows]
        scale = np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
        theta = np.linalg.lstsq(whole / scale, y[rows], rcond=1e-10)[0] / scale
        equation = zero.moved(theta[:count])
        inside = stabilised(equation.denominator, LARGEST_START)
        equation = dataclasses.replace(equation, a=inside[1:])
        found.append(equation)
        denominator = equation.denominator
    return found
