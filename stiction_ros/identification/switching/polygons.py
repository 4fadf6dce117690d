r"""Every switching pattern of the semi-physical law round a friction, for a given start.

A slip in direction σ gives :math:`\chi_k = (1 - K) \chi_{k-1} + K (u_k - \sigma f_D)`. So with the
pattern of slips given, the stem is affine in f_D and in the stem position ℓ before the first
sample, :math:`\chi_k = \alpha_k - \beta_k f_D + \gamma_k \ell`, and so is the lead
:math:`e_k = u_k - \chi_{k-1}`. A stay says :math:`|e_k| \le f_S`, a slip
:math:`\sigma e_k > f_S`: with ℓ given, half-planes of the plane of (f_S, f_D). The frictions with
one and the same pattern fill a convex polygon, and the polygons tile the plane. They are listed
one after another by cutting a region along their edges until nothing of it is left.

With K near 2 the past is not forgotten: under slips that alternate, γ shrinks by 1 % and β grows
by about 2 at each. After a hundred slips a polygon is 0.001 % wide or less in f_D.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray

SMALLEST = 1e-12


@dataclasses.dataclass(frozen=True)
class AffineTrace:
    """The stem α − β f_D + γ ℓ of one pattern.

    Attributes:
        alpha, beta, gamma: shape (N,).
        lead: constant, f_D's and ℓ's coefficient of e_k, shape (3, N).
        slip: direction of the slip at each sample, 0 where the stem stays, shape (N,).
    """

    alpha: FloatArray
    beta: FloatArray
    gamma: FloatArray
    lead: FloatArray
    slip: FloatArray

    def half_planes(self, level: float) -> tuple[FloatArray, FloatArray]:
        """Return rows A (R, 2) and b (R,) of A (f_S, f_D) ≤ b, the pattern's frictions."""
        constant, dynamic = self.lead[0] + self.lead[2] * level, self.lead[1]
        stay, slip = self.slip == 0.0, self.slip != 0.0
        sign = self.slip[slip]
        minus, plus = -np.ones(int(stay.sum())), np.ones(int(slip.sum()))
        rows = [
            np.column_stack([minus, dynamic[stay]]),
            np.column_stack([minus, -dynamic[stay]]),
            np.column_stack([plus, -sign * dynamic[slip]]),
        ]
        ends = [-constant[stay], constant[stay], sign * constant[slip]]
        return np.vstack(rows), np.concatenate(ends)

    def levels(self, friction: FloatArray) -> tuple[float, float]:
        """Return the range of ℓ in which (f_S, f_D) has this pattern, %."""
        f_s, f_d = (float(value) for value in friction)
        fixed, slope = self.lead[0] + self.lead[1] * f_d, self.lead[2]
        sign = np.where(self.slip == 0.0, 1.0, self.slip)
        one, other = f_s - sign * fixed, -f_s - sign * fixed
        rate = sign * slope
        stay = self.slip == 0.0
        rows = np.concatenate([rate[stay], -rate[stay], -rate[~stay]])
        ends = np.concatenate([one[stay], -other[stay], -one[~stay]])
        with np.errstate(divide="ignore", invalid="ignore"):
            limits = ends / rows
        return (
            float(limits[rows < 0.0].max(initial=-np.inf)),
            float(limits[rows > 0.0].min(initial=np.inf)),
        )


def trace(u: FloatArray, friction: FloatArray, overshoot: float, level: float) -> AffineTrace:
    """Return the pattern of (f_S, f_D) for a stem at ``level`` % before the first sample."""
    f_s, f_d = (float(value) for value in friction)
    keep = 1.0 - overshoot
    state, stem = (0.0, 0.0, 1.0), level
    states, begins, directions = [state], [0], [0.0]
    for k, value in enumerate(u.tolist()):
        error = value - stem
        if abs(error) <= f_s:
            continue
        sign = 1.0 if error > 0.0 else -1.0
        stem += overshoot * (error - sign * f_d)
        alpha, beta, gamma = state
        state = (
            keep * alpha + overshoot * value,
            keep * beta + overshoot * sign,
            keep * gamma,
        )
        states.append(state)
        begins.append(k)
        directions.append(sign)
    after = np.repeat(np.array(states), np.diff([*begins, len(u)]), axis=0).T
    before = np.column_stack([[0.0, 0.0, 1.0], after[:, :-1]])
    slip = np.zeros(len(u))
    slip[begins[1:]] = directions[1:]
    lead = np.stack([u - before[0], before[1], -before[2]])
    return AffineTrace(after[0], after[1], after[2], lead, slip)


@dataclasses.dataclass(frozen=True)
class PolygonCell:
    """One pattern and the part of its frictions that lies in the region.

    Attributes:
        corners: rows (f_S, f_D), %, shape (V, 2).
        trace: the pattern's stem.
    """

    corners: FloatArray
    trace: AffineTrace

    def static_range(self, dynamic: float) -> tuple[float, float]:
        """Return the f_S of the polygon at one f_D, %."""
        ends = []
        for one, two in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
            low, high = sorted((float(one[1]), float(two[1])))
            if low <= dynamic <= high:
                share = (dynamic - one[1]) / (two[1] - one[1]) if high > low else 0.0
                ends += [float(one[0] + share * (two[0] - one[0]))]
                ends += [float(two[0])] if high == low else []
        return min(ends), max(ends)


def region(centre: FloatArray, reach: FloatArray, limit: float) -> FloatArray:
    """Return the corners of centre ± reach inside the triangle 0 ≤ f_D ≤ f_S ≤ limit."""
    (fs, fd), (ws, wd) = centre, reach
    corners = np.array(
        [[fs - ws, fd - wd], [fs + ws, fd - wd], [fs + ws, fd + wd], [fs - ws, fd + wd]]
    )
    for row, end in (([0.0, -1.0], 0.0), ([-1.0, 1.0], 0.0), ([1.0, 0.0], limit)):
        corners = cut(corners, np.array(row), end)[0]
    return corners


def cut(corners: FloatArray, row: FloatArray, end: float) -> tuple[FloatArray, FloatArray]:
    """Return the parts of a convex polygon with row · x ≤ end and with row · x ≥ end."""
    inside: list[FloatArray] = []
    outside: list[FloatArray] = []
    sides = corners @ row - end
    for i, side in enumerate(sides):
        j = (i + 1) % len(corners)
        if side <= 0.0:
            inside.append(corners[i])
        if side >= 0.0:
            outside.append(corners[i])
        if side * sides[j] < 0.0:
            crossing = corners[i] + side / (side - sides[j]) * (corners[j] - corners[i])
            inside.append(crossing)
            outside.append(crossing)
    return np.array(inside).reshape(-1, 2), np.array(outside).reshape(-1, 2)


def area(corners: FloatArray) -> float:
    """Return the area of a polygon."""
    if len(corners) < 3:
        return 0.0
    x, y = (corners - corners[0]).T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def enumerate_cells(
    u: FloatArray, corners: FloatArray, overshoot: float, level: float, most: int
) -> list[PolygonCell] | None:
    """Return cells that tile a convex region of the (f_S, f_D) plane.

    A pattern may be listed in several parts. Parts below 10⁻¹² of the region are left out.

    Args:
        most: largest number of cells; None comes back when there are more.
    """
    todo = [corners]
    found: list[PolygonCell] = []
    smallest = SMALLEST * area(corners)
    size = np.ptp(corners, axis=0) if len(corners) else np.zeros(2)
    while todo:
        part = todo.pop()
        if area(part) <= smallest:
            continue
        if len(found) >= most:
            return None
        seen = trace(u, part.mean(axis=0), overshoot, level)
        part, rests = _within(part, seen, level, size)
        todo += rests
        if len(part) > 2:
            found.append(PolygonCell(part, seen))
    return found


def cell_of(
    u: FloatArray, friction: FloatArray, overshoot: float, level: float, corners: FloatArray
) -> PolygonCell:
    """Return the cell that holds (f_S, f_D), cut off at a convex region."""
    seen = trace(u, friction, overshoot, level)
    return PolygonCell(_within(corners, seen, level, np.ptp(corners, axis=0))[0], seen)


def _within(
    part: FloatArray, seen: AffineTrace, level: float, size: FloatArray
) -> tuple[FloatArray, list[FloatArray]]:
    """Return the part of a convex polygon that has a pattern, and the parts cut off."""
    rows, ends = seen.half_planes(level)
    scale = np.abs(rows) @ size + 1e-300
    rests = []
    while len(part) > 2:
        beyond = ((part @ rows.T - ends) / scale).max(axis=0)
        worst = int(beyond.argmax())
        if beyond[worst] <= 1e-10:
            break
        part, rest = cut(part, rows[worst], float(ends[worst]))
        rests.append(rest)
    return part, rests
