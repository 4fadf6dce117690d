r"""ARX models of one output by least squares, and the one-step criterion of the paper.

.. math:: y_k = \phi_k^T \theta + c + v_k \quad (9), (13), \qquad
          \mathrm{SE} = \sum_{k \ge \varepsilon} (y_k - \phi_k^T \theta - c)^2 \quad (14)

The constant c is always fitted. Rivals with different delays are compared over the same rows: ε is
computed with the longest delay that is tried.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.linalg import lstsq

from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.signals.arx import arx_columns, driven
from stiction_ros.signals.polynomials import largest_root, recursion, stabilised

RANK_TOLERANCE = 1e-12
Delays = tuple[tuple[int, ...], ...]


@dataclasses.dataclass(frozen=True)
class ArxOrders:
    """Orders of the ARX equations and the first row of the criterion.

    Raises:
        InputError: a value out of range.
    """

    output: int  # n_a ≥ 1
    input: int  # n_b ≥ 1, for every valve
    first: int  # ε, first sample of the criterion, at least n_a and n_b plus the longest delay
    # for each output its n_a^(i) and the n_bj^(i) of every valve, (8a) to (8c), none above
    # ``output`` and ``input``; None where all are alike
    channels: tuple[tuple[int, tuple[int, ...]], ...] | None = None

    def __post_init__(self) -> None:
        for key in ("output", "input"):
            if getattr(self, key) < 1:
                raise InputError(f"order {getattr(self, key)} is below 1", where=key)
        for output, inputs in self.channels or ():
            if not 1 <= output <= self.output or not all(1 <= n <= self.input for n in inputs):
                raise InputError(
                    f"orders {output}, {inputs} do not lie between 1 and the largest", where="na"
                )
        if self.first < max(self.output, self.input):
            raise InputError(f"row {self.first} has no complete past", where="first")

    @classmethod
    def over(cls, output: int, input: int, longest_delays: Sequence[int]) -> "ArxOrders":
        """Return orders with ε = max(n_a, Σ_j (n_b + t_d,j)) as printed under (12).

        Args:
            output: n_a.
            input: n_b.
            longest_delays: for each valve the longest delay of the tried range, samples.
        """
        return cls(output, input, max(output, sum(input + delay for delay in longest_delays)))

    def of_output(self, output: int, valves: int) -> tuple[int, tuple[int, ...]]:
        """Return n_a^(i) and the n_bj^(i) of all valves, for the output at this place."""
        if self.channels is None:
            return self.output, (self.input,) * valves
        return self.channels[output]

    def kept(self, output: int, valves: int) -> BoolArray:
        """Return which entries of θ^(i) are unknowns, shape (n_a + m n_b,); others are 0."""
        past, inputs = self.of_output(output, valves)
        rows = [np.arange(self.input) < count for count in inputs]
        return np.concatenate([np.arange(self.output) < past, *rows])


@dataclasses.dataclass(frozen=True)
class ArxFit:
    """Least-squares ARX model of one output."""

    delays: tuple[int, ...]  # t_d per valve, samples
    a: FloatArray  # a_1 … a_na, shape (n_a,), sign as in (8a)
    b: FloatArray  # shape (m, n_b), engineering units of PV per % of travel
    constant: float  # c, engineering units
    squared_error: float  # SE of (14), squared engineering units
    residuals: FloatArray  # y − ŷ from sample ε on, shape (N − ε,)

    @property
    def largest_root(self) -> float:
        """Modulus of the largest root of A(q); the model is stable below 1."""
        return largest_root(np.append(1.0, self.a))

    def judged(self, y: FloatArray, stems: FloatArray, orders: ArxOrders) -> "ArxFit":
        """Return the same model with SE and residuals over output y, (N,), and stems, (m, N)."""
        theta = np.concatenate([self.a, self.b.ravel()])
        predicted = regressors(y, stems, self.delays, orders) @ theta + self.constant
        residuals = y[orders.first :] - predicted
        error = float(residuals @ residuals)
        return dataclasses.replace(self, squared_error=error, residuals=residuals)

    def free_run(self, y: FloatArray, stems: FloatArray, first: int) -> FloatArray:
        """Return the free run from sample ``first`` on, started from the measured past.

        Args:
            y: measured output, shape (N,).
            stems: shape (m, N), %.
            first: ε.

        Returns:
            Shape (N − first,); not finite where an unstable model overflows.
        """
        drive = driven(self.b, self.delays, stems, self.constant)[first:]
        return recursion(np.append(1.0, self.a), drive, y[first - len(self.a) : first])


def regressors(
    y: FloatArray, stems: FloatArray, delays: tuple[int, ...], orders: ArxOrders
) -> FloatArray:
    """Return Φ of (13) without the constant, shape (N − ε, n_a + m n_b)."""
    columns = arx_columns(-y, stems, delays, (orders.output, orders.input), orders.first)
    return np.stack(columns, axis=1)


def fit_arx(
    y: FloatArray,
    stems: FloatArray,
    delays: tuple[int, ...],
    orders: ArxOrders,
    kept: BoolArray | None = None,
) -> ArxFit:
    """Fit one output by least squares, (9) and (13) with a constant.

    Columns are centred and scaled and then solved by a rank-revealing QR decomposition, so
    that SE is good to about 1e-12 of itself. A stem that never moves has no effect.

    Args:
        y: output, shape (N,), engineering units.
        stems: shape (m, N), %.
        delays: t_d per valve, samples.
        orders: n_a, n_b, ε.
        kept: entries of θ that are unknowns; None for all.

    Raises:
        InputError: a delay that reaches back before the first sample, or too few rows.
    """
    if max(delays, default=0) + orders.input > orders.first:
        raise InputError(
            f"delay {max(delays)} reaches back before the first sample",
            where="delay",
            fix=f"compute the first row with it; it is {orders.first}",
        )
    if len(y) - orders.first <= orders.output + len(stems) * orders.input + 1:
        raise InputError(f"{len(y)} samples are too few for an ARX model", fix="use more samples")
    phi, target = regressors(y, stems, delays, orders), y[orders.first :]
    middle, level = phi.mean(axis=0), float(target.mean())
    phi = phi - middle
    scale = np.sqrt(np.einsum("ij,ij->j", phi, phi))
    moving = scale > 1e-13 * np.maximum(1.0, np.abs(middle)) * np.sqrt(len(phi))
    if kept is not None:
        moving &= kept
    phi = phi[:, moving] / scale[moving]
    centred = target - level
    solution = lstsq(phi, centred, cond=RANK_TOLERANCE, lapack_driver="gelsy")[0]
    residuals = centred - phi @ solution
    theta = np.zeros(len(scale))
    theta[moving] = solution / scale[moving]
    return ArxFit(
        delays=delays,
        a=theta[: orders.output],
        b=theta[orders.output :].reshape(len(stems), orders.input),
        constant=level - float(middle @ theta),
        squared_error=float(residuals @ residuals),
        residuals=residuals,
    )


def stable_arx(
    y: FloatArray,
    stems: FloatArray,
    delays: tuple[int, ...],
    orders: ArxOrders,
    kept: BoolArray | None = None,
    radius: float = 0.99,
) -> ArxFit:
    """Return :func:`fit_arx`, or where that is unstable a stable model near it.

    Roots outside ``radius`` are pulled onto that circle; then b and c are fitted again.
    """
    fit = fit_arx(y, stems, delays, orders, kept)
    if fit.largest_root < 1.0:
        return fit
    free = np.ones(len(stems) * orders.input, bool) if kept is None else kept[orders.output :]
    a = stabilised(np.concatenate([[1.0], fit.a]), radius)[1:]
    phi = regressors(y, stems, delays, orders)
    rest = y[orders.first :] - phi[:, : orders.output] @ a
    columns = np.column_stack([phi[:, orders.output :][:, free], np.ones(len(rest))])
    solution = lstsq(columns, rest, cond=RANK_TOLERANCE, lapack_driver="gelsy")[0]
    residuals = rest - columns @ solution
    flat = np.zeros(len(free))
    flat[free] = solution[:-1]
    b = flat.reshape(len(stems), orders.input)
    error = float(residuals @ residuals)
    return ArxFit(delays, a, b, float(solution[-1]), error, residuals)
