r"""(12a) as a function of the frictions alone: the coefficients are eliminated.

.. math:: V(f) = \min_\theta \frac1p \sum_i \mathrm{SE}^{(i)}(f, \theta)

is linear least squares in θ. Past outputs and the constant are projected out once.
"""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.smoothed_laws import final_smoothing, smooth_law
from stiction_ros.records import Record
from stiction_ros.signals.arx import lagged
from stiction_ros.signals.arx_fit import ArxOrders, Delays

RIDGE = 1e-11  # on normal equations of unit columns: a stem that rests has no effect
KEPT = 4096  # stems that are kept for the other choices of delays


class StemTable:
    """Stems of one record by friction, kept for all choices of delays.

    Attributes:
        record: what was measured.
        limits: f_max per valve, shape (m,), %.
        orders: n_a, n_b, ε.
        law: of the valves.
        made: stems that were simulated.
    """

    def __init__(
        self, record: Record, limits: FloatArray, orders: ArxOrders, law: str = "he"
    ) -> None:
        self.record, self.limits, self.orders = record, limits, orders
        self.law = smooth_law(law)
        self.made = 0
        self._smoothing = final_smoothing(limits)
        self._kept: dict[bytes, FloatArray] = {}

    def stems(self, friction: FloatArray) -> FloatArray:
        """Return the stems of frictions of shape (m, 2), shape (m, N), %."""
        key = np.round(friction, 9).tobytes()
        found = self._kept.get(key)
        if found is None:
            self.made += 1
            if len(self._kept) >= KEPT:
                self._kept.clear()
            found = self.law.stems(self.record.op, friction, self._smoothing)
            self._kept[key] = found
        return found


class Criterion:
    """V(f) for one choice of delays, and the share of (12f).

    Attributes:
        table: stems of the record.
        delays: for each output the t_d of each valve, samples.
        evaluations: different frictions that were evaluated.
    """

    def __init__(self, table: StemTable, delays: Delays) -> None:
        self.table, self.delays = table, delays
        self.evaluations = 0
        self._kept: dict[bytes, tuple[float, FloatArray]] = {}
        orders, count = table.orders, len(table.record)
        self._past, self._rest = [], []
        for i, y in enumerate(table.record.pv.T):
            y = y - y.mean()
            past = orders.of_output(i, len(table.limits))[0]
            columns = lagged(-y, range(1, past + 1), orders.first)
            whole = np.column_stack([*columns, np.ones(count - orders.first)])
            basis = np.linalg.qr(whole)[0]
            target = y[orders.first :]
            self._past.append(basis)
            self._rest.append(target - basis @ (basis.T @ target))
        self._variance = np.maximum(table.record.op.var(axis=0), 1e-300)

    def __call__(self, friction: FloatArray) -> tuple[float, FloatArray]:
        """Return V, squared engineering units, and σ²(χ) / σ²(u) per valve, shape (m,)."""
        key = np.round(friction, 9).tobytes()
        if key not in self._kept:
            if len(self._kept) >= KEPT:
                self._kept.clear()
            self.evaluations += 1
            stems = self.table.stems(friction)
            errors = [self._error(i, stems) for i in range(len(self.delays))]
            self._kept[key] = float(np.mean(errors)), stems.var(axis=1) / self._variance
        return self._kept[key]

    def _error(self, output: int, stems: FloatArray) -> float:
        """Return SE (14) of one output with its best coefficients."""
        orders, delays, columns = self.table.orders, self.delays[output], []
        inputs = orders.of_output(output, len(stems))[1]
        for stem, delay, width in zip(stems - stems[:, :1], delays, inputs, strict=True):
            columns += lagged(stem, range(delay + 1, delay + width + 1), orders.first)
        phi, basis, rest = np.column_stack(columns), self._past[output], self._rest[output]
        phi = phi - basis @ (basis.T @ phi)
        norm = np.sqrt(np.einsum("ij,ij->j", phi, phi))
        phi = phi / np.maximum(norm, 1e-9)
        gram, right = phi.T @ phi, phi.T @ rest
        theta = np.linalg.solve(gram + RIDGE * np.eye(len(gram)), right)
        return float(rest @ rest - 2.0 * theta @ right + theta @ gram @ theta)
