"""What a search tried and what its answer is worth, for reports and benchmarks."""

import dataclasses
import math
from typing import Any

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.result import Identification
from stiction_ros.signals.arx_fit import Delays

CAPPED = "Maximum_Iterations_Exceeded"


@dataclasses.dataclass(frozen=True)
class SolvedStart:
    """One run of IPOPT from one start with one choice of delays."""

    delays: Delays  # for each output the t_d of each valve, samples
    start: tuple[tuple[float, float], ...]  # (f_S, f_D) per valve where it began, %
    end: tuple[tuple[float, float], ...]  # (f_S, f_D) per valve where it ended, %
    objective: float  # (12a) of the programme, squared engineering units
    status: str  # IPOPT's own word
    iterations: int  # of IPOPT
    feasible: bool  # whether all constraints hold
    stable: bool | None = None  # whether every A(q) is; None where the programme has none

    @property
    def accepted(self) -> bool:
        """Whether it may win: finite, feasible and stable."""
        return self.feasible and bool(self.stable) and math.isfinite(self.objective)


def pairs(friction: FloatArray) -> tuple[tuple[float, float], ...]:
    """Return rows (f_S, f_D), shape (m, 2), as plain numbers."""
    return tuple((float(static), float(dynamic)) for static, dynamic in friction)


@dataclasses.dataclass(frozen=True)
class SearchLog:
    """The answer of a method on the scale that all methods share, and the way to it."""

    # (12a) of the answer's (f_S, f_D, delays) under He's hard law with least-squares coefficients,
    # squared engineering units
    squared_error: float
    objective: float  # what the method itself minimised, same units
    points: int  # grid points, or frictions at which the programme evaluated (12a)
    starts: tuple[SolvedStart, ...] = ()  # starts of the nonlinear programme, in order

    @property
    def capped(self) -> int:
        """Runs of IPOPT that ended at their limit of iterations."""
        return sum(start.status == CAPPED for start in self.starts)


@dataclasses.dataclass(frozen=True, repr=False, kw_only=True)
class PaperIdentification(Identification):
    """What one of the paper's methods makes of a record."""

    search: SearchLog  # what the method tried and its squared error

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``identify --json`` but for ``record``."""
        document = super().to_dict()
        document["model"]["search"] = dataclasses.asdict(self.search)
        return document
