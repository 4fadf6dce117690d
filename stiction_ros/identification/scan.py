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
from stiction_ros.identification.scan_kernels import (
    explained_energy,
    filtered,
    lagged_products,
    subtract_projections,
)

BATCH = 160_000  # samples of all stems of a batch together, which stay in the cache


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
        self.numerator = np.asarray(numerator, dtype=float)
        self.denominator = np.asarray(denominator, dtype=float)
        self.plain = len(self.numerator) == 1 and len(self.denominator) == 1
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
        self._projector = projector.reshape(count, -1)

    def projected(self, x: FloatArray) -> FloatArray:
        """Return the products of lagged signals with basis and rest, shape (L, q + 1, G)."""
        return (self._projector.T @ x).reshape(len(self.lags), self.width, -1)

    def _filtered(self, x: FloatArray) -> FloatArray:
        """Return what the prefilter makes of signals, time along the last axis."""
        if self.plain:
            return x
        return np.asarray(lfilter(self.numerator, self.denominator, x, axis=-1))

    def energy(self, stems: FloatArray) -> FloatArray:
        """Return SE, shape (G, T), for stems of shape (N, G) and T delays."""
        batch = _Batch(self, stems)
        return self._energy(batch.products(batch), batch.right)

    def patterns(self, bases: FloatArray, signs: FloatArray) -> PatternEnergy:
        """Return SE of the stems base − level · sign as a function of the level.

        Args:
            bases, signs: shape (N, G).
        """
        x, s = _Batch(self, bases), _Batch(self, signs)
        cross = x.products(s) + s.products(x)
        return PatternEnergy(self, (x.products(x), cross, s.products(s)), (x.right, s.right))

    def _energy(self, products: FloatArray, right: FloatArray) -> FloatArray:
        """Return SE, shape (G, T), from lagged products (n_b, L, G) and right-hand side (L, G)."""
        explained = explained_energy(products, right)
        # What the rest explains to the last digit says nothing: its products are rounding.
        explained[explained > self.rest_energy * (1.0 + 1e-9)] = 0.0
        return np.asarray(np.maximum(self.rest_energy - explained, 1e-12 * self.rest_energy))


class _Batch:
    """Prefiltered signals, shape (N, G), and their products with basis and rest."""

    def __init__(self, scan: OutputScan, signals: FloatArray) -> None:
        self._scan = scan
        signals = np.ascontiguousarray(signals, dtype=float)
        self.x = signals if scan.plain else filtered(scan.numerator, scan.denominator, signals)
        self._projected = scan.projected(self.x)

    @property
    def right(self) -> FloatArray:
        """Products with the rest, shape (L, G)."""
        return self._projected[:, -1]

    def products(self, other: _Batch) -> FloatArray:
        """Return lagged products of what the basis leaves of both, shape (n_b, L, G)."""
        scan = self._scan
        orders, lags = scan.orders, scan.lags
        out = lagged_products(self.x, other.x, orders.first, lags[0], len(lags), orders.input)
        if other is self:  # a ridge, as a stem that stands still says nothing
            out[0] *= 1.0 + 1e-13
            out[0] += 1e-200
        subtract_projections(out, self._projected[:, :-1], other._projected[:, :-1])
        return out


class PatternEnergy:
    """SE of switching patterns as a function of f_D; the stem is affine in it."""

    def __init__(
        self,
        scan: OutputScan,
        products: tuple[FloatArray, FloatArray, FloatArray],
        rights: tuple[FloatArray, FloatArray],
    ) -> None:
        self._scan, self._products, self._rights = scan, products, rights

    def __call__(self, levels: FloatArray) -> FloatArray:
        """Return SE, shape (G, F, T), for f_D of shape (G, F)."""
        (xx, cross, ss), (x, s) = self._products, self._rights
        parts = [self._scan._energy(xx - f * cross + f**2 * ss, x - f * s) for f in levels.T]
        return np.stack(parts, axis=1)
