"""The one-step criterion (12a) of given stems: the mean of SE (14) over outputs, units of PV²."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals.arx_fit import ArxFit, ArxOrders, Delays, fit_arx


@dataclasses.dataclass(frozen=True)
class EquationError:
    """The criterion of one record with its stems, shape (m, N), %, and an ARX model per output."""

    fits: tuple[ArxFit, ...]
    stems: FloatArray

    @property
    def squared_error(self) -> float:
        """Mean of SE over the outputs, (12a), squared engineering units."""
        return float(np.mean([fit.squared_error for fit in self.fits]))


def fit_outputs(
    pv: FloatArray, stems: FloatArray, delays: Delays, orders: ArxOrders
) -> EquationError:
    """Fit every output: PV, shape (N, p), of stems, shape (m, N), %, with t_d of each valve."""
    fits = tuple(
        fit_arx(y, stems, row, orders, orders.kept(i, len(stems)))
        for i, (y, row) in enumerate(zip(pv.T, delays, strict=True))
    )
    return EquationError(fits, stems)
