"""What a search tried and what its answer is worth, for reports and benchmarks."""

from __future__ import annotations

import dataclasses
from typing import Any

from stiction_ros.identification.equation_error import Delays


@dataclasses.dataclass(frozen=True)
class SolvedStart:
    """One start of the nonlinear programme with one choice of delays.

    Attributes:
        kind: ``border``, ``ellipse``, ``restart`` or ``delay``.
        delays: for each output the t_d of each valve, samples.
        start: (f_S, f_D) per valve where it began, %.
        rough: (f_S, f_D) per valve after the strongly smoothed stages, %; the start itself
            where there were none.
        end: (f_S, f_D) per valve where it ended, %.
        objective: (12a) of the programme, squared engineering units.
        status: IPOPT's own word at the last stage.
        iterations: of IPOPT over all stages.
        feasible, stable: whether constraints hold and every A(q) is stable.
    """

    kind: str
    delays: Delays
    start: tuple[tuple[float, float], ...]
    rough: tuple[tuple[float, float], ...]
    end: tuple[tuple[float, float], ...]
    objective: float
    status: str
    iterations: int
    feasible: bool
    stable: bool

    @property
    def accepted(self) -> bool:
        """Whether it may win."""
        return self.feasible and self.stable

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        return dataclasses.asdict(self)


@dataclasses.dataclass(frozen=True)
class SearchLog:
    """The answer of a method on the scale that all methods share, and the way to it.

    Attributes:
        squared_error: (12a) of the answer's (f_S, f_D, delays) under He's hard law with
            least-squares coefficients, squared engineering units;
            see :func:`stiction_ros.identification.equation_error.squared_error`.
        objective: what the method itself minimised, same units.
        output_order, input_order, first: n_a, n_b and ε of both.
        points: grid points or starts that were worked through.
        delays_tried: number of choices of delays.
        starts: every start of the nonlinear programme, in order; empty for the others.
        friction, delays: what ``squared_error`` belongs to where that is not the answer of the
            method: (f_S, f_D) per valve, %, and the t_d of each valve per output.
    """

    squared_error: float
    objective: float
    output_order: int
    input_order: int
    first: int
    points: int
    delays_tried: int
    starts: tuple[SolvedStart, ...] = ()
    friction: tuple[tuple[float, float], ...] = ()
    delays: Delays = ()

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        return dataclasses.asdict(self)
