"""Sum of squares of one output for many stem trajectories and all delays at once.

Once the data are filtered by D/A of a nearby model, the noise model's criterion is a linear
least-squares problem again (Steiglitz and McBride); with D = A = 1 it is the one-step SE (14).
What does not depend on the scanned valve is projected out once; the rest is a batch of
n_b × n_b systems built from lagged correlations.
"""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.kernels.delay import delay_energy
from stiction_ros.identification.kernels.filter import Window
from stiction_ros.identification.kernels.scan import least_energy, remaining_tails, step_products
from stiction_ros.identification.problem.output_error import Orders
from stiction_ros.identification.switching import StepSignals

BATCH = 500  # signals that are worked on together
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
        # Columns that every stem has beside its own: a signal by its index, and its lag.
        signals = np.zeros((len(others) + 4, len(numerator) - 1 + count))
        y_row, ones, impulse, left_free = 0, *range(len(others) + 1, len(others) + 4)
        rows = signals[:, len(numerator) - 1 :]
        rows[y_row], rows[1:ones], rows[ones] = y, others, 1.0
        rows[impulse, first - orders.noise - len(denominator)] = 1.0
        columns = [(y_row, lag) for lag in range(1, orders.output + 1)]
        for j, skipped in enumerate(other_delays):
            columns += [(1 + j, skipped + lag) for lag in range(1, orders.input + 1)]
        columns.append((ones, 0))
        if free is not None:
            rows[left_free] = free
            columns += [(left_free, lag) for lag in lags]
        columns += [(impulse, lag) for lag in range(len(denominator) - 1)]
        tails, self.rest_energy = remaining_tails(
            signals,
            np.array(columns),
            (first, count + lags[-1] + 1),
            (numerator, denominator),
            EXPLAINED,
        )
        self.count = count - first
        self._window = Window(
            count, first, lags[0], len(lags), orders.input, tails, numerator, denominator
        )

    def energy(self, stems: StepSignals) -> FloatArray:
        """Return SE, shape (G, T), for G stems and T delays."""
        products, right = step_products(self._window, stems.offsets, stems.places, stems.values)
        return delay_energy(products, right, self.rest_energy)

    def least_energy(self, stems: StepSignals) -> tuple[FloatArray, IntArray]:
        """Return the least SE over the delays and the place of its delay, shape (G,) each."""
        rows = stems.offsets, stems.places, stems.values
        return least_energy(self._window, *rows, self.rest_energy)

    def patterns(self, patterns: StepSignals) -> "PatternEnergy":
        """Return what SE of the stems base − level · sign is computed from, the two channels."""
        products, rights = step_products(
            self._window, patterns.offsets, patterns.places, patterns.values
        )
        return PatternEnergy(products, rights)


@dataclasses.dataclass(frozen=True)
class PatternEnergy:
    """What SE of switching patterns is computed from; the stem is affine in f_D."""

    # of what the columns leave of base with base, base with sign and sign with sign, shape (G, 3,
    # n_b, L)
    products: FloatArray
    rights: FloatArray  # of base and sign with the rest, shape (G, 2, L)

    @property
    def delays(self) -> int:
        """T, number of delays."""
        return int(self.products.shape[3] - self.products.shape[2] + 1)
