r"""Switching patterns of the laws with a moving state: Kano's, XCH and Choudhury's.

While these valves move, χ_k = u_k − σ f_D; once they stop, at the OP u_s of the last moving
sample, the stem stays at u_s − σ f_D. When they stop depends on OP alone, and what releases them
compares :math:`u_k - u_s` with J = f_S − f_D or S = f_S + f_D. So the frictions with one pattern
fill a rectangle in the plane of (J, S), and inside it the stem is affine in f_D.

- Kano and XCH: a moving valve follows OP until OP rests or turns, :math:`\sigma (u_k - u_{k-1})
  \le 0`; a stopped one slips on when :math:`\sigma (u_k - u_s) > J` and back when
  :math:`-\sigma (u_k - u_s) > S`.
- Choudhury: a moving valve stops when the slope of OP changes its sign; a stopped one slips, at
  samples whose slope has the sign of the sample before, when :math:`|u_k - u_s|` exceeds S, or J
  where OP rested as it stopped and goes on in the same direction.

Before the first slip the threshold is f_S for all of them.
"""

import dataclasses
from collections.abc import Iterable
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray

FirstSlip = tuple[int, float]


@dataclasses.dataclass(frozen=True)
class MovingTrace:
    """Where one valve moves, stops and slips, and what that says of J and S."""

    base: FloatArray  # OP at the last moving sample, first the stem's level, shape (N,)
    sign: FloatArray  # direction of the last motion, 0 before the first, shape (N,)
    bounds: tuple[float, float, float, float]  # (J low, J high, S low, S high), %


class MovingRules:
    """How a valve with a moving state follows OP u, shape (N,): by Kano's law and XCH's."""

    waits: ClassVar[bool] = False  # whether it slips only where OP has run on for a sample

    def __init__(self, u: FloatArray) -> None:
        slope = np.sign(np.diff(u, prepend=u[:1]))
        self.u = u
        self.values: list[float] = u.tolist()
        self.slopes: list[float] = slope.tolist()
        self._may_slip = np.ones(len(u), dtype=bool)
        if self.waits:
            self._may_slip[:2] = False
            self._may_slip[2:] = (slope[2:] == slope[1:-1]) & (slope[2:] != 0.0)

    def resting_samples(self, level: float) -> NDArray[np.bool_]:
        """Return at which samples a valve that rests at ``level`` may slip, shape (N,).

        OP came to the first sample from there.
        """
        may = self._may_slip.copy()
        if self.waits and len(may) > 1:
            may[1] = self.slopes[1] == np.sign(self.values[0] - level) != 0.0
        return may

    def first_slip(self, level: float, static: float) -> FirstSlip:
        """Return sample and direction of the first slip; (N, 0) when there is none."""
        beyond = np.abs(self.u - level) > static
        slips = np.flatnonzero(beyond & self.resting_samples(level))
        if not len(slips):
            return len(self.u), 0.0
        return int(slips[0]), self.direction(int(slips[0]), level)

    def direction(self, k: int, level: float) -> float:
        """Return in which direction a valve that rests at ``level`` slips at sample k."""
        return self.slopes[k] if self.waits else float(np.sign(self.values[k] - level))

    def trace(
        self, point: Iterable[float], level: float, first: FirstSlip | None = None
    ) -> MovingTrace:
        """Return the trace of a valve at rest at ``level`` with J and S, %.

        The first slip, sample and direction, may be given; None lets f_S = (S + J)/2 decide.
        """
        jump, reverse = point
        if first is None:
            first = self.first_slip(level, 0.5 * (jump + reverse))
        moves, bounds = [(0, level, 0.0)], ([0.0, 0.0], [np.inf, np.inf])
        if first[0] < len(self.values):
            moves.append((first[0], self.values[first[0]], first[1]))
            self._follow(moves, bounds, jump, reverse)
        begins, bases, signs = zip(*moves, strict=True)
        lengths = np.diff([*begins, len(self.values)])
        (low, low_reverse), (high, high_reverse) = bounds
        bounded = low, high, low_reverse, high_reverse
        return MovingTrace(np.repeat(bases, lengths), np.repeat(signs, lengths), bounded)

    def _follow(
        self,
        moves: list[tuple[int, float, float]],
        bounds: tuple[list[float], list[float]],
        jump: float,
        reverse: float,
    ) -> None:
        """Follow OP behind the first slip, the last of ``moves``, with the given J and S, %.

        Each further move is noted with its sample, OP and direction, and what it says of the lower
        and upper bounds of J and S.
        """
        (begin, base, sign), moving, rested = moves[-1], True, False
        values, slopes, (low, high) = self.values, self.slopes, bounds
        for k in range(begin + 1, len(values)):
            value, slope = values[k], slopes[k]
            if moving and slope == sign:
                base = value
                moves.append((k, value, sign))
                continue
            lead = sign * (value - base)
            onwards, turned = lead > 0.0, sign if lead > 0.0 else -sign
            if self.waits:
                if moving:
                    moving, rested = False, slope == 0.0
                    continue
                if slope == 0.0 or slope != slopes[k - 1]:
                    continue
                onwards, turned = rested and slope == sign, slope
            way = 0 if onwards else 1  # compared with J or with S
            moving, far = False, abs(lead)
            if far > (reverse if way else jump):
                high[way] = min(high[way], far)
                moving, sign, base = True, turned, value
                moves.append((k, value, sign))
            elif far > low[way]:
                low[way] = far


class SlopeRules(MovingRules):
    """Those of Choudhury's law."""

    waits = True
