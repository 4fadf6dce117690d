"""The paper's one-step criterion (14), re-evaluated for given stems, delays and orders."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import OutputModel
from stiction_ros.records import Record


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
    columns = [(-y, lag) for lag in range(1, len(output.a) + 1)]
    for valve, b in output.b.items():
        chi = stem[:, record.valves.index(valve)]
        columns += [(chi, lag + output.delay[valve]) for lag in range(1, len(b) + 1)]
    first = max(lag for _, lag in columns)
    regressors = np.column_stack(
        [signal[first - lag : len(y) - lag] for signal, lag in columns] + [np.ones(len(y) - first)]
    )
    # Centring and scaling keep the constant from spoiling the other columns.
    middle, spread = regressors.mean(axis=0), regressors.std(axis=0)
    middle[-1], spread[spread == 0.0] = 0.0, 1.0
    scaled = (regressors - middle) / spread
    theta = np.linalg.lstsq(scaled, y[first:], rcond=None)[0]
    return np.concatenate([y[:first], scaled @ theta])
