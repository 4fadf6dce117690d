"""The paper's one-step criterion (14), re-evaluated for given stems, delays and orders."""

from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import OutputModel
from stiction_ros.records import Record
from stiction_ros.signals.arx_fit import ArxOrders, fit_arx


def square_error(record: Record, stem: FloatArray, outputs: Sequence[OutputModel]) -> float:
    """Return (1/p) Σ SE, (12a) and (14), in squared units of PV.

    The coefficients are those of least squares, with a constant; only orders and delays are
    taken from ``outputs``.

    Args:
        record: that is predicted.
        stem: stem positions, shape (N, m), %.
        outputs: one entry per output of the record.
    """
    errors = []
    for output in outputs:
        measured = record.pv[:, record.outputs.index(output.name)]
        apart = measured - one_step_estimate(record, stem, output)
        errors.append(float(apart @ apart))
    return float(np.mean(errors))


def one_step_estimate(record: Record, stem: FloatArray, output: OutputModel) -> FloatArray:
    """Return ŷ of (12c), shape (N,); the first ε samples are measured ones (Remark 1).

    Args:
        record, stem: as for :func:`square_error`.
        output: whose orders and delays are used.
    """
    y = record.pv[:, record.outputs.index(output.name)]
    stems = np.array([stem[:, record.valves.index(valve)] for valve in output.b])
    delays = tuple(output.delay[valve] for valve in output.b)
    past = len(next(iter(output.b.values())))
    orders = ArxOrders(len(output.a), past, max(len(output.a), past + max(delays)))
    residuals = fit_arx(y, stems, delays, orders).residuals
    return np.concatenate([y[: orders.first], y[orders.first :] - residuals])
