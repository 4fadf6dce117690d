"""Sum of squares of one output for many stem trajectories and all delays at once.

Once the data are filtered by D/A of a nearby model, the noise model's criterion is a linear
least-squares problem again (Steiglitz and McBride); with D = A = 1 it is the one-step SE (14).
What does not depend on the scanned valve is projected out once; the rest is a batch of
n_b × n_b systems built from lagged correlations.
"""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.kernels.row import through
from stiction_ros.identification.kernels.scan import (
    Window,
    least_energy,
    orthonormal,
    step_products,
)
from stiction_ros.identification.problem.output_error import Orders
from stiction_ros.identification.switching import StepSignals

EXPLAINED = 1e-7  # of a column, below which the others explain it


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

    Raises:
        ValueError: a window that begins too early for the lags.
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
        first, count, lags = orders.first, len(y), range(delay[0] + 1, delay[1] + orders.input + 1)
        reach = [lags[-1], orders.noise + len(denominator), orders.output]
        reach += [skipped + orders.input for skipped in other_delays]
        if first < max(reach):
            raise ValueError(f"the window begins at {first}, before what its lags need")
        numerator = np.ascontiguousarray(numerator, dtype=float)
        denominator = np.ascontiguousarray(denominator, dtype=float)
        impulse = (np.arange(count) == first - orders.noise - len(denominator)).astype(float)
        # Signals that every stem has beside itself, each with its lags.
        beside: list[tuple[FloatArray, range]] = [(y, range(1, orders.output + 1))]
        for other, skipped in zip(others, other_delays, strict=True):
            beside.append((other, range(skipped + 1, skipped + orders.input + 1)))
        beside.append((np.ones(count), range(1)))
        if free is not None:
            beside.append((free, lags))
        beside.append((impulse, range(len(denominator) - 1)))
        filtered = through(np.array([row for row, _ in beside]), numerator, denominator, count)
        pairs = [(row, lag) for row, (_, own) in zip(filtered, beside, strict=True) for lag in own]
        found = np.array([row[first - lag : count - lag] for row, lag in pairs])
        basis, target = orthonormal(found, EXPLAINED), filtered[0, first:]
        rest = target - (basis @ target) @ basis
        self.rest_energy = max(float(rest @ rest), 1e-300)
        products = np.ascontiguousarray(np.vstack([basis, rest])[:, ::-1])
        backwards = through(products, numerator, denominator, count)
        tails = np.zeros((count + lags[-1] + 1, len(backwards)))
        tails[:count] = np.cumsum(backwards, axis=1)[:, ::-1].T
        self.count, self.delays = count - first, len(lags) - orders.input + 1
        self._window = Window(
            count, first, lags[0], len(lags), orders.input, tails, numerator, denominator
        )

    def least_energy(self, stems: StepSignals) -> tuple[FloatArray, IntArray]:
        """Return the least SE over the delays and the place of its delay, shape (G,) each."""
        rows = stems.offsets, stems.places, stems.values
        return least_energy(self._window, *rows, self.rest_energy)

    def products(self, signals: StepSignals) -> tuple[FloatArray, FloatArray]:
        """Return the products of signals by lag, and those with the rest, of one channel or two."""
        return step_products(self._window, signals.offsets, signals.places, signals.values)
