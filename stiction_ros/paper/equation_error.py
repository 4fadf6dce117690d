"""The one-step criterion of the paper under He's law, for any friction: (12a), all outputs.

It is the mean of SE (14) over the outputs, in squared engineering units of PV.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.records.record import Record
from stiction_ros.signals.arx_fit import ArxFit, ArxOrders, Delays, fit_arx


@dataclasses.dataclass(frozen=True)
class EquationError:
    """The criterion of one record at one friction.

    Attributes:
        fits: one ARX model per output.
        stems: simulated stem positions, shape (m, N), %.
    """

    fits: tuple[ArxFit, ...]
    stems: FloatArray

    @property
    def squared_error(self) -> float:
        """Mean of SE over the outputs, (12a), squared engineering units."""
        return float(np.mean([fit.squared_error for fit in self.fits]))


def fit_outputs(
    pv: FloatArray, stems: FloatArray, delays: Delays, orders: ArxOrders
) -> EquationError:
    """Fit every output.

    Args:
        pv: shape (N, p), engineering units.
        stems: shape (m, N), %.
        delays: for each output the t_d of each valve, samples.
        orders: n_a, n_b, ε.
    """
    fits = tuple(
        fit_arx(y, stems, row, orders, orders.kept(i, len(stems)))
        for i, (y, row) in enumerate(zip(pv.T, delays, strict=True))
    )
    return EquationError(fits, stems)


def simulate_stems(op: FloatArray, friction: FloatArray) -> FloatArray:
    """Return stem positions under He's law (4), shape (m, N), %.

    The stem before the first sample is the first OP.

    Args:
        op: shape (N, m), %.
        friction: rows (f_S, f_D), shape (m, 2), %; f_D above f_S is taken as f_S.
    """
    rows = np.column_stack([friction[:, 0], np.minimum(friction[:, 0], friction[:, 1])])
    stems = [
        HeStiction.simulate_grid(row[None, :], u, float(u[0]))[:, 0]
        for u, row in zip(op.T, rows, strict=True)
    ]
    return np.array(stems)


def evaluate(
    record: Record, friction: FloatArray, delays: Delays, orders: ArxOrders
) -> EquationError:
    """Simulate He's valve (4) and fit every output: any method's answer on equal terms.

    Args:
        record: what was measured.
        friction: rows (f_S, f_D) per valve, shape (m, 2), %.
        delays: for each output the t_d of each valve, samples.
        orders: n_a, n_b, ε.

    Raises:
        InputError: shapes that do not fit the record, or a friction that is no number ≥ 0.
    """
    friction = np.asarray(friction, dtype=float)
    if friction.shape != (len(record.valves), 2):
        raise InputError(f"friction has shape {friction.shape}", where=record.name)
    if not (np.isfinite(friction).all() and (friction >= 0.0).all()):
        raise InputError("friction is negative or not finite", where=record.name)
    if [len(row) for row in delays] != [len(record.valves)] * len(record.outputs):
        raise InputError("delays need one row per output, one entry per valve", where="delay")
    return fit_outputs(record.pv, simulate_stems(record.op, friction), delays, orders)


def squared_error(record: Record, friction: FloatArray, delays: Delays, orders: ArxOrders) -> float:
    """Return (12a) of :func:`evaluate`: SE under He's hard law, squared engineering units."""
    return evaluate(record, friction, delays, orders).squared_error
