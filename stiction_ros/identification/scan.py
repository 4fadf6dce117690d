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
    ) -> None:
        self.orders, self.delay = orders, delay
        self.numerator, self.denominator = numerator, denominator
        first, count = orders.first, len(y)
        target = self._filtered(y)
        columns = [target[first - i : count - i] for i in range(1, orders.output + 1)]
        for stem, lag in zip(self._filtered(others), other_delays, strict=True):
            columns += [stem[first - lag - i : count - lag - i] for i in range(1, orders.input + 1)]
        columns.append(self._filtered(np.ones(count))[first:])
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
        self.projector = np.ascontiguousarray(np.column_stack([basis, rest]))

    def _filtered(self, x: FloatArray) -> FloatArray:
        if len(self.numerator) == 1 and len(self.denominator) == 1:
            return x
        return np.asarray(lfilter(self.numerator, self.denominator, x, axis=-1))

    def loss(self, stems: FloatArray) -> FloatArray:
        """Return n log(SE / n), shape (G, T), for stems of shape (G, N) and T delays."""
        x = self._filtered(stems)
        low, high = self.delay
        nb, first, count = self.orders.input, self.orders.first, x.shape[1]
        lags = range(low + 1, high + nb + 1)
        projected = np.stack([x[:, first - i : count - i] @ self.projector for i in lags])
        products = self._autocorrelations(x, lags)
        size, delays = len(x), high - low + 1
        gram = np.empty((delays, size, nb, nb))
        right = np.empty((delays, size, nb))
        for t in range(delays):
            right[t] = projected[t : t + nb, :, -1].T
            for i in range(nb):
                for j in range(i, nb):
                    part = np.einsum("gq,gq->g", projected[t + i, :, :-1], projected[t + j, :, :-1])
                    gram[t, :, i, j] = gram[t, :, j, i] = products[j - i][t + i] - part
        floor = np.stack([products[0][t : t + nb].max(axis=0) for t in range(delays)])
        diagonal = np.arange(nb)
        gram[..., diagonal, diagonal] += 1e-10 * floor[..., None] + 1e-200
        solution = np.linalg.solve(gram, right[..., None])[..., 0]
        explained = np.einsum("tgi,tgi->gt", right, solution)
        energy = np.maximum(self.rest_energy - explained, 1e-12 * self.rest_energy)
        return np.asarray(self.count * np.log(energy / self.count))

    def _autocorrelations(self, x: FloatArray, lags: range) -> list[FloatArray]:
        """Return, per difference d < n_b, sums of x[k−l] x[k−l−d] for all lags l; (L, G)."""
        first, count = self.orders.first, x.shape[1]
        result = []
        for d in range(self.orders.input):
            i = lags[0]
            now = np.einsum(
                "gn,gn->g", x[:, first - i : count - i], x[:, first - i - d : count - i - d]
            )
            sums = [now]
            for i in lags[:-1]:
                last = count - 1 - i
                now = now + x[:, first - i - 1] * x[:, first - i - 1 - d]
                now = now - x[:, last] * x[:, last - d]
                sums.append(now)
            result.append(np.stack(sums))
        return result
