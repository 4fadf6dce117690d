"""Sum of squares of one output for many stem trajectories and all delays at once.

Once the data are filtered by D/A of a nearby model, the noise model's criterion is a linear
least-squares problem again (Steiglitz and McBride); with D = A = 1 it is the one-step SE (14).
What does not depend on the scanned valve is projected out once; the rest is a batch of
n_b × n_b systems built from lagged correlations.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.output_error import Orders


class OutputScan:
    """Criterion of one output as a function of one valve's stem.

    Args:
        y: output about its mean, shape (N,).
        others: stems of the other valves, shape (m − 1, N).
        other_delays: their delays, samples.
        orders: n_a, n_b, p and the window.
        delay: inclusive range of the scanned valve's delay.
        numerator, denominator: D and A of the prefilter; ones for the one-step criterion.
        free: a signal in the stem whose size is unknown, shape (N,); what it explains at any
            delay is projected out.
    """

    def __init__(
        self,
        y: FloatArray,
        others: FloatArray,
        other_delays: tuple[int, ...],
        orders: Orders,
        delay: tuple[int, int],
        numerator: FloatArray,
        denominator: FloatArray,
        free: FloatArray | None = None,
    ) -> None:
        self.orders, self.delay = orders, delay
        self.numerator, self.denominator = numerator, denominator
        first, count = orders.first, len(y)
        target = self._filtered(y)
        columns = [target[first - i : count - i] for i in range(1, orders.output + 1)]
        for stem, lag in zip(self._filtered(others), other_delays, strict=True):
            columns += [stem[first - lag - i : count - lag - i] for i in range(1, orders.input + 1)]
        columns.append(self._filtered(np.ones(count))[first:])
        self.lags = range(delay[0] + 1, delay[1] + orders.input + 1)
        if free is not None:
            filtered = self._filtered(free)
            columns += [filtered[first - lag : count - lag] for lag in self.lags]
        impulse = np.zeros(count)
        impulse[first - orders.noise - len(denominator)] = 1.0
        impulse = self._filtered(impulse)
        columns += [impulse[first - i : count - i] for i in range(len(denominator) - 1)]
        matrix = np.stack(columns, axis=1)
        matrix /= np.sqrt(np.einsum("ij,ij->j", matrix, matrix)) + 1e-300
        left, values, _ = np.linalg.svd(matrix, full_matrices=False)
        basis = left[:, values > 1e-7 * values[0]]
        rest = target[first:] - basis @ (basis.T @ target[first:])
        self.count = count - first
        self.rest_energy = max(float(rest @ rest), 1e-300)
        # One column block per lag, so that all projections are one matrix product.
        self.width = basis.shape[1] + 1
        projector = np.zeros((count, len(self.lags), self.width))
        for position, lag in enumerate(self.lags):
            projector[first - lag : count - lag, position, :-1] = basis
            projector[first - lag : count - lag, position, -1] = rest
        self.projector = projector.reshape(count, -1)

    def _filtered(self, x: FloatArray) -> FloatArray:
        if len(self.numerator) == 1 and len(self.denominator) == 1:
            return x
        return np.asarray(lfilter(self.numerator, self.denominator, x, axis=-1))

    def energy(self, stems: FloatArray) -> FloatArray:
        """Return SE, shape (G, T), for stems of shape (G, N) and T delays."""
        x = self._filtered(stems)
        projected = self._projected(x)
        return self._energy(self._gram(x, x, projected, projected), projected[..., -1])

    def patterns(self, bases: FloatArray, signs: FloatArray) -> PatternEnergy:
        """Return SE of the stems base − level · sign as a function of the level.

        Args:
            bases, signs: shape (G, N).
        """
        x, s = self._filtered(bases), self._filtered(signs)
        px, ps = self._projected(x), self._projected(s)
        cross = self._gram(x, s, px, ps)
        return PatternEnergy(
            self,
            (self._gram(x, x, px, px), cross + cross.transpose(1, 0, 2), self._gram(s, s, ps, ps)),
            (px[..., -1], ps[..., -1]),
        )

    def _gram(self, x: FloatArray, s: FloatArray, px: FloatArray, ps: FloatArray) -> FloatArray:
        gram = self._products(x, s)
        if x is s:  # a ridge, as a stem that stands still says nothing
            diagonal = np.arange(len(gram))
            gram[diagonal, diagonal] *= 1.0 + 1e-13
            gram[diagonal, diagonal] += 1e-200
        gram -= np.einsum("lgq,mgq->lmg", px[..., :-1], ps[..., :-1], optimize=True)
        return gram

    def _projected(self, x: FloatArray) -> FloatArray:
        """Return the products of lagged signals with basis and rest, shape (L, G, q + 1)."""
        product = (x @ self.projector).reshape(len(x), len(self.lags), self.width)
        return np.ascontiguousarray(product.transpose(1, 0, 2))

    def _energy(self, gram: FloatArray, right: FloatArray) -> FloatArray:
        """Return SE, shape (G, T), from Gram (L, L, G) and right-hand side (L, G)."""
        nb, size = self.orders.input, right.shape[1]
        delays = len(self.lags) - nb + 1
        lag = np.arange(delays)[:, None] + np.arange(nb)
        matrix = gram[lag[:, :, None], lag[:, None, :]].transpose(3, 0, 1, 2).copy()
        vector = right[lag].transpose(2, 0, 1).copy()
        # What the rest explains to the last digit says nothing: its Gram matrix is rounding.
        diagonal = np.arange(nb)
        empty = ~(matrix[..., diagonal, diagonal] > 0.0).all(axis=-1)
        matrix[empty] = np.eye(nb)
        vector[empty] = 0.0
        matrix[..., diagonal, diagonal] *= 1.0 + 1e-12 * (1.0 + diagonal)
        solution = np.linalg.solve(matrix, vector[..., None])[..., 0]
        explained = np.einsum("gti,gti->gt", vector, solution).reshape(size, delays)
        explained[explained > self.rest_energy * (1.0 + 1e-9)] = 0.0
        return np.asarray(np.maximum(self.rest_energy - explained, 1e-12 * self.rest_energy))

    def _products(self, x: FloatArray, s: FloatArray) -> FloatArray:
        """Return sums of x[k − l] s[k − m] over the window, shape (L, L, G), |l − m| < n_b."""
        first, count = self.orders.first, x.shape[1]
        out = np.zeros((len(self.lags), len(self.lags), len(x)))
        for d in range(self.orders.input):
            pairs = [(x, s)] if d == 0 or x is s else [(x, s), (s, x)]
            for swap, (one, two) in enumerate(pairs):
                lag = self.lags[0]
                now = np.einsum(
                    "gn,gn->g",
                    one[:, first - lag : count - lag],
                    two[:, first - lag - d : count - lag - d],
                )
                for position in range(len(self.lags) - d):
                    row, column = position, position + d
                    if swap:
                        row, column = column, row
                    out[row, column] = now
                    if x is s:
                        out[column, row] = now
                    last, before = count - 1 - lag, first - lag - 1
                    now = (
                        now + one[:, before] * two[:, before - d] - one[:, last] * two[:, last - d]
                    )
                    lag += 1
        return out


class PatternEnergy:
    """SE of switching patterns as a function of f_D; the stem is affine in it."""

    def __init__(
        self,
        scan: OutputScan,
        grams: tuple[FloatArray, FloatArray, FloatArray],
        rights: tuple[FloatArray, FloatArray],
    ) -> None:
        self._scan, self._grams, self._rights = scan, grams, rights

    def __call__(self, levels: FloatArray) -> FloatArray:
        """Return SE, shape (G, F, T), for f_D of shape (G, F)."""
        (xx, cross, ss), (x, s) = self._grams, self._rights
        parts = [self._scan._energy(xx - f * cross + f**2 * ss, x - f * s) for f in levels.T]
        return np.stack(parts, axis=1)
