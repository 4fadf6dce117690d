r"""Apparent stiction S_0 from an ellipse through the points of PV(OP), reference [15].

The ellipse is the conic

.. math:: A x^2 + B x y + C y^2 + D x + E y + F = 0, \qquad 4 A C - B^2 = 1

of least algebraic distance (x = OP, y = PV, both scaled). With D_1 = [x², xy, y²],
D_2 = [x, y, 1] and S_ij = D_iᵀ D_j, the linear terms follow from the quadratic ones,
t = −S_22⁻¹ S_12ᵀ q, and q is an eigenvector of K⁻¹ (S_11 − S_12 S_22⁻¹ S_12ᵀ), where
qᵀ K q = 4AC − B²; the one with positive 4AC − B² is the ellipse.

S_0 is the x-width: the length of the chord through the centre along OP.
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
