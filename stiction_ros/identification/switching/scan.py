"""Evaluated switching patterns: what each costs and which frictions lie in its cell."""

import dataclasses
import math

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, IntArray


@dataclasses.dataclass(frozen=True)
class PatternScan:
    """Evaluated cells."""

    bounds: FloatArray  # rows (J low, J high, S low, S high), %, shape (G, 4)
    dynamic: FloatArray  # range of f_D in the cell, shape (G, 2)
    level: FloatArray  # best f_D in the cell, shape (G,)
    curvature: FloatArray  # second derivative of the loss in f_D, shape (G,)
    loss: FloatArray  # n log(SE / n) at the best f_D and delays, summed over outputs, shape (G,)
    delays: FloatArray  # best delay per output, shape (G, p)
    moves: FloatArray  # number of stem moves, shape (G,)

    @staticmethod
    def joined(parts: "list[PatternScan]") -> "PatternScan":
        """Return all cells of several scans."""
        names = [field.name for field in dataclasses.fields(PatternScan)]
        return PatternScan(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))

    def chosen(self, cells: IntArray) -> "PatternScan":
        """Return some of the cells, by their indices."""
        names = [field.name for field in dataclasses.fields(PatternScan)]
        return PatternScan(*(getattr(self, name)[cells] for name in names))

    def static_range(self, index: int, dynamic: tuple[float, float]) -> tuple[float, float]:
        """Return the values of f_S in a cell for f_D in a range, %."""
        jl, jh, sl, sh = self.bounds[index].tolist()
        least, most = dynamic
        low = min(max(0.5 * (sl - jl), least), most)
        high = min(max(0.5 * (sh - jh), least), most) if math.isfinite(jh) else most
        return max(jl + low, sl - low, low), min(jh + high, sh - high)

    def middle(self, index: int, limit: float) -> tuple[float, float]:
        """Return f_S in the middle of a cell at its best f_D, and that f_D, %."""
        f_d = float(self.level[index])
        low, high = self.static_range(index, (f_d, f_d))
        return 0.5 * (low + min(high, limit)), f_d

    def accepted_dynamic(self, index: int, allowance: float) -> tuple[float, float]:
        """Return the values of f_D in a cell whose loss exceeds its best by ``allowance``."""
        curvature = max(float(self.curvature[index]), 1e-300)
        reach = float(np.sqrt(2.0 * max(allowance, 0.0) / curvature))
        low, high = self.dynamic[index]
        level = self.level[index]
        return float(max(low, level - reach)), float(min(high, level + reach))
