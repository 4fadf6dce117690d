"""The likelihood of a gap: linear columns projected out, autoregressive noise, innovations."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.discrepancy.likelihood.least_squares import (
    coefficients,
    left_by,
    projector,
    whitened_block,
    whitened_columns,
)
from stiction_ros.discrepancy.likelihood.slow_noise import FIGURES, slow_beside_white
from stiction_ros.discrepancy.measures import (
    MARGIN,
    NEGLIGIBLE,
    ROUNDING,
    ROUNDS,
    SETTLED,
    SURPRISE,
)
from stiction_ros.effects import FloatArray
from stiction_ros.effects.behaviour import BoolArray
from stiction_ros.signals.autoregression import (
    TINY,
    best_autoregression,
    gain_of_noise,
    whiten,
    whitened_rows,
)

MAX_ORDER = 6


@dataclasses.dataclass(frozen=True)
class Blocks:
    """Which samples are fitted and which are kept back."""

    train: BoolArray  # train, held: rows, shape (N,); a row is in at most one of them
    held: BoolArray
    # share of the values that were measured: those between values that a historian kept say nothing
    measured: float = 1.0

    @property
    def scored(self) -> BoolArray:
        """Rows of either kind; none at the start of a record, where a state runs anywhere."""
        return np.asarray(self.train | self.held)


@dataclasses.dataclass(frozen=True)
class NoiseFit:
    r"""One output's gap under autoregressive noise, its linear part fitted by least squares.

    .. math::
        g_k &= x_k^T \beta + r_k \\
        r_k &= \varphi_1 r_{k-1} + \ldots + \varphi_p r_{k-p} + e_k, \quad p \le 6
    """

    ar: FloatArray  # φ, shape (p,)
    innovation_std: float  # of e on the training rows, units of the output
    coefficients: FloatArray  # β, shape (q,)
    residual: FloatArray  # r, shape (N,)
    minus_two_log: float  # n (log 2πσ² + 1) on the n measured values of the training rows
    rows: float  # n
    # −2 log likelihood of the held-out rows with the trained figures; innovations beyond 5 σ count
    # as 5 σ, so that no single row outweighs all others
    held_minus_two_log: float
    price: float  # what its φ cost in BIC; nothing for those that the model declares
    enlarged: bool = False  # whether it is another noise than the one that the model declares
    # φ of the autoregression that it is better than; None where it is one itself
    short: FloatArray | None = None

    @property
    def searched(self) -> FloatArray:
        """φ under which points of a search are compared, of six terms at most where it is found."""
        return self.ar if self.short is None else self.short

    @property
    def innovations(self) -> FloatArray:
        """Innovations e, shape (N,); the first p reach before the record and are not used."""
        return whiten(self.residual, self.ar)

    @property
    def stationary_std(self) -> float:
        """Standard deviation of r under its own model; inf where that is not stationary."""
        return self.innovation_std * math.sqrt(gain_of_noise(self.ar))

    def bic(self, parameters: int) -> float:
        """Return −2 log likelihood, the price of φ and ``parameters`` log n."""
        return self.minus_two_log + self.price + parameters * math.log(max(self.rows, 2))


def fit_noise(
    target: FloatArray,
    columns: FloatArray,
    blocks: Blocks,
    starts: Sequence[FloatArray | None] = (None,),
) -> NoiseFit:
    """Fit the linear columns and the noise to a gap by Gaussian likelihood, in turns.

    Args:
        target: the gap, shape (N,).
        columns: linear columns, shape (N, q).
        blocks: rows; the first :data:`MAX_ORDER` of every run are in neither.
        starts: φ to begin with, each once; None is white noise.

    Returns:
        The best of the turns from all starts; the order p is the one of least BIC.
    """
    own = {b"" if start is None else start.tobytes(): start for start in starts}
    turns = [_in_turns(target, columns, blocks, start) for start in own.values()]
    _, beta, residual, ar = min(turns, key=lambda turn: turn[0])
    found = _result(residual, beta, ar, blocks, len(ar))
    return found if len(ar) <= FIGURES else _remembering(target, columns, blocks, found)


def _in_turns(
    target: FloatArray, columns: FloatArray, blocks: Blocks, start: FloatArray | None
) -> tuple[float, FloatArray, FloatArray, FloatArray]:
    """Return the score, β, what they leave and φ, both fitted in turns as long as that gains."""
    ar = np.zeros(0) if start is None else start
    best: tuple[float, FloatArray, FloatArray, FloatArray] | None = None
    for _ in range(ROUNDS):
        beta, residual = _linear_part(target, columns, blocks.train, ar)
        fitted, score = best_autoregression(residual, blocks.train, MAX_ORDER)
        if best is not None and score >= best[0] - SETTLED:
            break
        best = (score, beta, residual, fitted)
        if np.array_equal(fitted, ar):  # the next turn would be this one
            break
        ar = fitted
    assert best is not None
    return best


def _remembering(
    target: FloatArray, columns: FloatArray, blocks: Blocks, short: NoiseFit
) -> NoiseFit:
    """Return the fit under white noise beside a first-order one, where that explains more.

    An autoregression needs many terms for what two figures say, and ends before the noise forgets.
    """
    best = short
    for _ in range(ROUNDS):
        ar = slow_beside_white(best.residual, blocks.train)
        left = given_noise(target, columns, blocks, ar)
        price = FIGURES * math.log(max(left.rows, 2))
        left = dataclasses.replace(left, price=price, short=short.ar)
        if left.bic(0) >= best.bic(0) - SETTLED:
            break
        best = left
    return best


def noise_forms(
    target: FloatArray,
    columns: FloatArray,
    blocks: Blocks,
    starts: Sequence[FloatArray | None],
    declared: Sequence[FloatArray] = (),
) -> list[NoiseFit]:
    """Fit the linear columns under the declared noise, and under a larger one with its price.

    Args:
        target, columns, blocks: as for :func:`fit_noise`.
        starts: of the search for a noise of its own.
        declared: φ of the noise that the model declares, several where an effect may or may
            not colour it; none where it declares nothing.
    """
    own = fit_noise(target, columns, blocks, starts)
    if not declared:
        return [own]
    own = dataclasses.replace(own, price=own.price + MARGIN, enlarged=True)
    return [own, *(given_noise(target, columns, blocks, ar) for ar in declared)]


def given_noise(
    target: FloatArray, columns: FloatArray, blocks: Blocks, ar: FloatArray
) -> NoiseFit:
    """Fit the linear columns under noise whose φ are given, its spread left open."""
    beta, residual = _linear_part(target, columns, blocks.train, ar)
    return _result(residual, beta, ar, blocks)


def _linear_part(
    target: FloatArray, columns: FloatArray, train: BoolArray, ar: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return β by whitened least squares of the fitted rows, and what it leaves, shape (N,)."""
    white = whitened_block(np.ascontiguousarray(columns.T), ar, train, ROUNDING)
    beta = coefficients(white, whitened_rows(np.ascontiguousarray(target), ar, train))
    unseen = ~white.any(axis=1)
    if unseen.any():  # the innovations do not show them, the free run does
        seen = np.ascontiguousarray(columns[train][:, unseen].T)
        beta[unseen] = coefficients(seen, (target - columns @ beta)[train])
    return beta, target - columns @ beta


def _result(
    residual: FloatArray, beta: FloatArray, ar: FloatArray, blocks: Blocks, count: int = 0
) -> NoiseFit:
    """Return what a fit left; ``count`` figures of its noise are its own and cost something."""
    inside = whitened_rows(residual, ar, blocks.train)
    outside = whitened_rows(residual, ar, blocks.held)
    total = float(inside @ inside)
    variance = max(total / max(len(inside), 1), TINY)
    kept_back = np.minimum(outside**2, SURPRISE**2 * total / max(len(inside), 1))
    log, rows = math.log(2.0 * math.pi * variance), blocks.measured * len(inside)
    return NoiseFit(
        ar,
        math.sqrt(variance),
        beta,
        residual,
        rows * (log + 1.0),
        rows,
        blocks.measured * (len(outside) * log + float(kept_back.sum()) / variance),
        count * math.log(max(rows, 2)),
    )


def information(
    columns: FloatArray, shared: FloatArray, noise: NoiseFit, blocks: Blocks
) -> FloatArray:
    """Return the information of one output on the factors, shape (s, s).

    Args:
        columns: of the factors, shape (N, s).
        shared: columns that every fit projects out, shape (N, q).
        noise: under which they are judged.
        blocks: rows; the fitted ones count.
    """
    basis = projector(whitened_columns(shared, noise.ar, blocks.train))
    white = left_by(basis, whiten(columns, noise.ar)[blocks.train])
    return np.asarray(blocks.measured * white.T @ white / max(noise.innovation_std, 1e-300) ** 2)


def shared_factors(
    sizes: Mapping[int, FloatArray],
    shared: Sequence[FloatArray],
    noise: Mapping[int, NoiseFit],
    blocks: Sequence[Blocks],
) -> FloatArray:
    """Return the factors that all outputs have in common, shape (s,).

    Each output's own factors count by their information.

    Args:
        sizes: per output the columns of the factors, shape (N, s).
        shared: per output the columns that every fit projects out.
        noise: per output its own fit, whose first coefficients are its factors.
        blocks: per output its rows.
    """
    known = {i: information(sizes[i], shared[i], noise[i], blocks[i]) for i in sizes}
    total = np.sum(list(known.values()), axis=0)
    wanted = np.sum([known[i] @ noise[i].coefficients[: sizes[i].shape[1]] for i in sizes], axis=0)
    return np.asarray(np.linalg.pinv(total) @ wanted)


_ROOT = math.sqrt(2.0)


def grouped(fit: NoiseFit, quantum: float, blocks: Blocks) -> NoiseFit:
    r"""Return a fit whose likelihood is that of values rounded to a quantum.

    .. math::
        -2 \log L = -2 \sum_k \log \frac{1}{q} \left[ \Phi\left(\frac{e_k + q/2}{\sigma}\right)
        - \Phi\left(\frac{e_k - q/2}{\sigma}\right) \right]

    with σ at its best. What lies within half a quantum is explained already: nothing gains by
    following the lattice.

    Args:
        fit: under Gaussian noise.
        quantum: q, > 0, units of the output.
        blocks: rows that are fitted and kept back.
    """
    from scipy.optimize import minimize_scalar

    white = fit.innovations
    inside, held = (np.ascontiguousarray(white[rows]) for rows in (blocks.train, blocks.held))
    low = math.log(NEGLIGIBLE * quantum)
    high = math.log(max(3.0 * float(np.std(inside)), 2.0 * NEGLIGIBLE * quantum))
    best = minimize_scalar(
        lambda x: _minus_two_log(inside, quantum, math.exp(x), np.inf),
        bounds=(low, high),
        method="bounded",
    )
    return dataclasses.replace(
        fit,
        minus_two_log=float(best.fun),
        held_minus_two_log=_minus_two_log(held, quantum, math.exp(best.x), SURPRISE),
    )


def best_noise(
    fits: Sequence[NoiseFit], quantum: float = 0.0, blocks: Blocks | None = None
) -> NoiseFit:
    """Return the fit of least BIC, by the likelihood of rounded values where there is a quantum."""
    if quantum > 0.0 and blocks is not None:
        fits = [grouped(fit, quantum, blocks) for fit in fits]
    return min(fits, key=lambda fit: fit.bic(0))


@compiled
def _minus_two_log(white: FloatArray, quantum: float, spread: float, most: float) -> float:
    """Return −2 log likelihood of grouped innovations, each at most ``most`` σ off its group."""
    total = 0.0
    half = 0.5 * quantum
    for k in range(len(white)):
        away = min(abs(white[k]), half + most * spread)
        upper = 0.5 * math.erfc((away - half) / spread / _ROOT)
        lower = 0.5 * math.erfc((away + half) / spread / _ROOT)
        total -= 2.0 * math.log(max(upper - lower, TINY) / quantum)
    return total
