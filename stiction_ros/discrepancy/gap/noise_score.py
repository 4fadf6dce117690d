"""How likely a gap is under a law of its noise beside the declared one: a Kalman filter's score."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.linalg import block_diag

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap.noise_laws import FLOOR, Block, Law
from stiction_ros.discrepancy.likelihood.noise import SURPRISE, VANISHED, Blocks
from stiction_ros.discrepancy.likelihood.state_noise import innovations, left_by_columns
from stiction_ros.effects.behaviour import BoolArray, FloatArray

CLOSE, FLAT, TURNS = 1e-2, 0.05, 60  # of the search: figures, their likelihood, turns
_TINY = 1e-300


@dataclasses.dataclass(frozen=True)
class Shown:
    """What is judged: the gap and the columns that every fit projects out.

    Attributes:
        values: shape (1 + q, N).
        seen: rows that are measurements, shape (N,).
        begins: first rows of records, shape (N,).
    """

    values: FloatArray
    seen: BoolArray
    begins: BoolArray


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
