r"""Where the nonlinear programme starts: border and line f_S + f_D = S_0 as printed, and inside.

The apparent stiction S_0 is that of an ellipse through the points of PV(OP), reference [15]: of the
conic

.. math:: A x^2 + B x y + C y^2 + D x + E y + F = 0, \qquad 4 A C - B^2 = 1

of least algebraic distance (x = OP, y = PV, both scaled) the length of the chord through the centre
along OP. With D_1 = [x², xy, y²], D_2 = [x, y, 1] and S_ij = D_iᵀ D_j, the linear terms follow from
the quadratic ones, t = −S_22⁻¹ S_12ᵀ q, and q is an eigenvector of K⁻¹ (S_11 − S_12 S_22⁻¹ S_12ᵀ),
where qᵀ K q = 4AC − B²; the one with positive 4AC − B² is the ellipse.
"""

import dataclasses
import itertools

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records.record import Record

WINDOWS = 8
MIN_POINTS = 20
# K⁻¹ for q = (A, B, C).
INVERSE_CONSTRAINT = np.array([[0.0, 0.0, 0.5], [0.0, -1.0, 0.0], [0.5, 0.0, 0.0]])
STEP = 0.5
MAX_LINE = 3
LINE_POINTS = 20
# Inverse powers of the plastic number: multiples of them cover the square evenly.
EVEN = np.array([0.7548776662466927, 0.5698402909980532])


@dataclasses.dataclass(frozen=True)
class Ellipse:
    """An ellipse through points (x, y)."""

    chord: float  # length of the chord through the centre along x; S_0 for x = OP, %
    misfit: float  # RMS of (radius / radius of the ellipse − 1) over the points


def fit_ellipse(x: FloatArray, y: FloatArray) -> Ellipse | None:
    """Return the least-squares ellipse through points x, y, each of shape (N,); None for none."""
    if len(x) < MIN_POINTS:
        return None
    spread_x, spread_y = float(x.std()), float(y.std())
    if min(spread_x, spread_y) <= 1e-12 * max(1.0, float(np.abs(x).max()), float(np.abs(y).max())):
        return None
    scaled_x, scaled_y = (x - x.mean()) / spread_x, (y - y.mean()) / spread_y
    conic = _conic(scaled_x, scaled_y)
    if conic is None:
        return None
    A, B, C, D, E, F = conic.tolist()
    determinant = 4.0 * A * C - B * B
    x0, y0 = (B * E - 2.0 * C * D) / determinant, (B * D - 2.0 * A * E) / determinant
    level = -(F + 0.5 * (D * x0 + E * y0))  # q(x − x0) = level on the ellipse
    if not (np.isfinite(level) and level / A > 0.0):
        return None
    dx, dy = scaled_x - x0, scaled_y - y0
    radius = np.sqrt(np.maximum((A * dx * dx + B * dx * dy + C * dy * dy) / level, 0.0))
    chord = 2.0 * float(np.sqrt(level / A)) * spread_x
    return Ellipse(chord, float(np.sqrt(np.mean((radius - 1.0) ** 2))))


def _conic(x: FloatArray, y: FloatArray) -> FloatArray | None:
    """Return (A, B, C, D, E, F) with A > 0, or None where no ellipse comes out."""
    quadratic = np.stack([x * x, x * y, y * y], axis=1)
    linear = np.stack([x, y, np.ones_like(x)], axis=1)
    count = len(x)
    s11, s12 = quadratic.T @ quadratic / count, quadratic.T @ linear / count
    s22 = linear.T @ linear / count
    if np.linalg.cond(s22) > 1e12:
        return None
    to_linear = -np.linalg.solve(s22, s12.T)
    reduced = INVERSE_CONSTRAINT @ (s11 + s12 @ to_linear)
    vectors = np.real(np.linalg.eig(reduced)[1])
    form = 4.0 * vectors[0] * vectors[2] - vectors[1] ** 2
    best = int(form.argmax())
    if not form[best] > 1e-10:
        return None
    q = vectors[:, best] * np.sign(vectors[0, best])
    return np.concatenate([q, to_linear @ q])


def apparent_stictions(record: Record) -> FloatArray:
    """Return S_0 ≈ f_S + f_D of every valve, shape (m,), % of OP; 0 without an ellipse.

    A set-point move draws a wide path that is not the cycle. So ``WINDOWS`` equal parts of the
    record are tried with every output, those in which OP spans between half of and the whole
    of what it spans in the middle part, and the ellipse of least misfit is taken. Where there
    is none the whole record is tried.
    """
    return np.array([_of_valve(record, j) for j in range(len(record.valves))])


def _of_valve(record: Record, valve: int) -> float:
    u, count = record.op[:, valve], len(record)
    edges = np.linspace(0, count, WINDOWS + 1).astype(int).tolist()
    windows = list(itertools.pairwise(edges))
    spans = [float(np.ptp(u[a:b])) if b > a else 0.0 for a, b in windows]
    middle = float(np.median(spans))
    quiet = [w for w, span in zip(windows, spans, strict=True) if 0.5 * middle <= span <= middle]
    for tried in (quiet, [(0, count)]):
        fits = [fit_ellipse(u[a:b], pv[a:b]) for a, b in tried for pv in record.pv.T]
        found = [ellipse for ellipse in fits if ellipse is not None]
        if found:
            return min(found, key=lambda ellipse: ellipse.misfit).chord
    return 0.0


def border(limit: float) -> FloatArray:
    """Return the border of 0 ≤ f_D ≤ f_S ≤ limit in steps, shape (n, 2), %.

    From (0, 0) along f_D = 0 to (limit, 0), up to (limit, limit), and back along f_D = f_S.
    A triangle smaller than four steps is walked in quarters of its side.
    """
    step = min(STEP, limit / 4.0)
    nodes = np.append(np.arange(0.0, limit - 1e-9 * limit, step), limit)
    rows = [(value, 0.0) for value in nodes]
    rows += [(limit, value) for value in nodes[1:]]
    rows += [(value, value) for value in nodes[-2:0:-1]]
    return np.array(rows)


def stiction_line(stiction: float, limit: float, count: int) -> FloatArray:
    """Return ``count`` points with f_S + f_D = S_0, shape (count, 2), %.

    Evenly over S_0 / 2 ≤ f_S ≤ S_0, ends left out, and cut off at ``limit``.
    """
    share = (np.arange(count) + 0.5) / max(count, 1)
    static = np.minimum(0.5 * stiction * (1.0 + share), limit)
    return np.column_stack([static, np.clip(stiction - static, 0.0, static)])


def inside(limit: float, count: int) -> FloatArray:
    """Return ``count`` points, none of them round, over the triangle, shape (count, 2), %."""
    square = (0.5 + np.arange(1, count + 1)[:, None] * EVEN) % 1.0
    return limit * np.column_stack([square.max(axis=1), square.min(axis=1)])


def around(friction: FloatArray, limits: FloatArray, reach: float, count: int) -> list[FloatArray]:
    """Return up to ``count`` points about each valve's friction, others held, (m, 2) each.

    J = f_S − f_D and f_S + f_D go as far as ``reach``, a share of f_max.
    """
    found = []
    moves = 2.0 * ((0.5 + np.arange(1, count + 1)[:, None] * EVEN) % 1.0) - 1.0
    for j, limit in enumerate(limits.tolist()):
        for jump, band in (reach * limit * moves).tolist():
            static = float(friction[j, 0]) + 0.5 * (band + jump)
            dynamic = float(friction[j, 1]) + 0.5 * (band - jump)
            if 0.0 <= dynamic <= static <= limit:
                moved = friction.copy()
                moved[j] = static, dynamic
                found.append(moved)
    return found


def draw_starts(limits: FloatArray, stictions: FloatArray, count: int) -> tuple[FloatArray, ...]:
    """Return M starts for all valves at once as printed: rows (f_S, f_D), shape (m, 2) each, %.

    Up to three (and no more than half) lie on the line of S_0, the others evenly on the
    border. With several valves, valve j takes the list moved on by j, so that the valves do
    not all start at the same kind of point. A valve without an ellipse (S_0 = 0) starts
    on the border only.
    """
    on_line = min(MAX_LINE, count // 2)
    rows = []
    for j, (limit, stiction) in enumerate(zip(limits.tolist(), stictions.tolist(), strict=True)):
        lined = on_line if stiction > 0.0 else 0
        edge = border(limit)
        chosen = edge[(np.arange(count - lined) * len(edge)) // max(count - lined, 1)]
        points = np.vstack([stiction_line(stiction, limit, lined), chosen])
        rows.append(np.roll(points, -j, axis=0))
    return tuple(np.stack(rows, axis=1))


def candidates(limits: FloatArray, stictions: FloatArray, count: int) -> tuple[FloatArray, ...]:
    """Return points to choose starts from: one valve has friction, the others have none.

    S_0, %, is 0 without an ellipse; ``count`` points lie inside the widest triangle, as many
    for their area in the others. Each has rows (f_S, f_D), shape (m, 2), %.
    """
    found = [np.zeros((len(limits), 2))]
    for j, (limit, stiction) in enumerate(zip(limits.tolist(), stictions.tolist(), strict=True)):
        share = max(1, round(count * (limit / float(limits.max())) ** 2))
        parts = [border(limit)[1:], inside(limit, share)]
        if stiction > 0.0:
            parts.append(stiction_line(stiction, limit, LINE_POINTS))
        for point in np.vstack(parts):
            friction = np.zeros((len(limits), 2))
            friction[j] = point
            found.append(friction)
    return tuple(found)
