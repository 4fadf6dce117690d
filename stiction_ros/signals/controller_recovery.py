r"""The controller of a loop, recovered from SP, PV and OP by least squares.

In velocity form, over a span of h samples and with the error e = SP − PV behind a filter,

.. math::

    u_k - u_{k-h} = K (e_k - e_{k-h}) + K_i \sum_{i=k-h+1}^{k} e_i
                    + K_d (\Delta e_k - \Delta e_{k-h}) + h c

e may be that of the sample before. A span of one sample is the textbook form; longer ones let
signals that are rounded, or held between reports, be told from their steps, so the shortest span
is taken whose fit is nearly as good as any. The constant c stands for a set-point that is not
recorded: it is there when the record has none, and the set-point is then the mean of PV plus
c / K_i, at which OP rests.
"""

import dataclasses
import enum
import itertools
from collections.abc import Mapping

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import BoolArray, FloatArray, IntArray
from stiction_ros.signals import holds

LEAST_FIT = 0.2  # R² from which on a controller is believed: rounded and held signals leave no more
NEARLY = 0.03  # R² that a shorter span may lose against the best one
# spans h tried, samples: about 1.6 times the one before
SPANS = (1, 2, 3, 5, 8, 12, 20, 32, 50, 80, 130)
LAGS = (0, 1, 2)  # samples between PV and the OP that answers it
FILTERS = (0.0, 0.5, 0.8)  # shares of the last value in the filter of the error, per sample
BLOCKS = 12  # blocks of the jackknife behind the standard errors
# R² of what is left that a sample of lag or a filter must explain to be taken, a derivative half
# more: with it the law of one sample later is another form of the law without
PRICE = 0.01
LEAST_ROWS = 30  # samples in automatic that a fit needs
CLIPPED_RUN = 5  # samples in a row at its end of range from which on OP may rest at a limit
# values between its ends that OP must take for a rest at an end to be a limit, not a step
CLIPPED_LEVELS = 20

Stretches = list[tuple[int, int]]


class ControllerStatus(enum.StrEnum):
    """Whether a controller was recovered."""

    OK = "ok"
    NO_MOVES = "no_moves"
    NO_RELATION = "no_relation"


@dataclasses.dataclass(frozen=True)
class RecoveredController:
    """A PI(D) controller in velocity form, all times in samples."""

    status: ControllerStatus  # ok, or why there is none
    reason: str  # one sentence; empty when ok
    set_point: FloatArray  # as recorded or found, shape (N,)
    # where OP was seen to rest while the controller would have gone on; infinite where it was not
    limits: tuple[float, float]
    # (K, K_i, K_d), OP per unit of PV and sample, signed for e = SP − PV, shape (3,)
    coefficients: FloatArray = dataclasses.field(default_factory=lambda: np.zeros(3))
    # of the coefficients from a jackknife over blocks, shape (3, 3)
    covariance: FloatArray = dataclasses.field(default_factory=lambda: np.zeros((3, 3)))
    lag: int = 0  # samples between PV and the OP that answers it
    smoothing: float = 0.0  # share of the last value in the filter of the error
    span: int = 1  # h, samples
    r_squared: float = 0.0  # share of the moves of OP over h samples that is explained

    @property
    def gain(self) -> float:
        """K, OP per unit of PV."""
        return float(self.coefficients[0])

    @property
    def integral_time(self) -> float:
        """T_i = K / K_i, samples; infinite without reset."""
        if self.coefficients[1] == 0.0:
            return float("inf")
        return float(self.coefficients[0] / self.coefficients[1])


def recover(
    op: FloatArray, pv: FloatArray, sp: FloatArray | None, stretches: Stretches, longest_span: int
) -> RecoveredController:
    """Return the controller between PV and OP.

    Args:
        op, pv: shape (N,).
        sp: shape (N,), or None when not recorded.
        stretches: first sample of each stretch in automatic and the one behind its last.
        longest_span: of h, samples; a third of the period of a cycle serves well.
    """
    rows = np.concatenate([np.arange(a, b) for a, b in stretches] or [np.empty(0, int)])
    rest = float(pv[rows].mean()) if len(rows) else 0.0
    set_point = np.full(len(pv), rest) if sp is None else sp
    limits = resting_limits(op[rows])
    free = (op < limits[1]) & (op > limits[0])
    scales = (_spread(op[rows]), _spread(set_point[rows] - pv[rows]))
    if len(rows) < LEAST_ROWS or min(scales) <= 0.0:
        reason = "OP or the error does not move in automatic"
        return RecoveredController(ControllerStatus.NO_MOVES, reason, set_point, limits)
    error = (set_point - pv) / scales[1]
    command = (op - float(op[rows].mean())) / scales[0]
    filtered = {
        share: [smoothed(error[first:last], share) for first, last in stretches]
        for share in FILTERS
    }
    data = _Data(command, filtered, sp is None, stretches, free)
    textbook = {
        span: _best(data, [_Form(lag, 0.0, False, span) for lag in LAGS])
        for span in SPANS
        if span <= max(longest_span, 1)
    }
    fits = {span: fit for span, fit in textbook.items() if fit is not None}
    if not fits:
        reason = f"fewer than {LEAST_ROWS} samples in automatic"
        return RecoveredController(ControllerStatus.NO_MOVES, reason, set_point, limits)
    top = max(fit.r_squared for fit in fits.values())
    span = next(span for span, fit in fits.items() if fit.r_squared >= top - NEARLY)
    kinds = itertools.product(LAGS, FILTERS, (False, True))
    chosen = _best(data, [_Form(*kind, span) for kind in kinds])
    assert chosen is not None
    return _told(chosen, set_point, limits, scales, data)


@dataclasses.dataclass(frozen=True)
class _Data:
    """Scaled: u, e of every stretch by its filter, whether SP is unknown, where OP is free."""

    command: FloatArray
    filtered: Mapping[float, list[FloatArray]]
    unknown: bool
    stretches: Stretches
    free: BoolArray


@dataclasses.dataclass(frozen=True)
class _Form:
    lag: int
    smoothing: float
    derivative: bool
    span: int

    @property
    def price(self) -> float:
        """What the form costs beyond the textbook one, as log of the squared rest."""
        return PRICE * (self.lag + (self.smoothing > 0.0) + 1.5 * self.derivative)


@dataclasses.dataclass(frozen=True)
class _Fit:
    form: _Form
    rows: int
    theta: FloatArray
    kept: BoolArray
    r_squared: float

    @property
    def worth(self) -> float:
        return -float(np.log(max(1.0 - self.r_squared, 1e-9))) - self.form.price


def _best(data: _Data, forms: list[_Form]) -> _Fit | None:
    fits = [fit for form in forms if (fit := _fit(data, form)) is not None]
    return max(fits, key=lambda fit: fit.worth, default=None)


@compiled
def _add_products(
    products: FloatArray,
    ends: IntArray,
    count: int,
    filtered: FloatArray,
    command: FloatArray,
    free: BoolArray,
    span: int,
    derivative: bool,
    unknown: bool,
) -> int:
    """Add the inner products of regressors and moves of one stretch; return how many rows were met.

    Args:
        products: of regressors and moves of each block of rows, the lower halves of shape
            (B, q + 1, q + 1).
        ends: row behind each block, shape (B,).
        count: rows of the stretches before.
        filtered: e of the samples before those of ``command``, and of these, shape (n + 1,).
        command: u, as many samples late as the form says, shape (n,).
        free: where OP is free, shape (n,).
        span: h.
        derivative, unknown: whether the form has a derivative, and whether SP is unknown.
    """
    size, block, total = products.shape[1], 0, 0.0
    row = np.empty(size)
    for k in range(len(command)):
        total += filtered[k + 1]
        if k >= span:
            total -= filtered[k + 1 - span]
        if k < span or not (free[k] and free[k - span]):
            continue
        row[0] = filtered[k + 1] - filtered[k + 1 - span]
        row[1] = total
        if derivative:
            row[2] = row[0] - filtered[k] + filtered[k - span]
        if unknown:
            row[size - 2] = span
        row[size - 1] = command[k] - command[k - span]
        while count >= ends[block]:
            block += 1
        for i in range(size):
            for j in range(i + 1):
                products[block, i, j] += row[i] * row[j]
        count += 1
    return count


def _products(data: _Data, form: _Form, ends: IntArray) -> tuple[FloatArray, int]:
    """Return the inner products of each block, shape (B, q + 1, q + 1), and the number of rows."""
    size = 3 + form.derivative + data.unknown
    products, rows = np.zeros((len(ends), size, size)), 0
    for (first, last), filtered in zip(data.stretches, data.filtered[form.smoothing], strict=True):
        start = first + form.lag + 1
        if last - start > form.span:
            rows = _add_products(
                products,
                ends,
                rows,
                filtered[: last - first - form.lag],
                data.command[start:last],
                data.free[start:last],
                form.span,
                form.derivative,
                data.unknown,
            )
    return products + np.tril(products, -1).swapaxes(1, 2), rows


def _fit(data: _Data, form: _Form) -> _Fit | None:
    (products,), rows = _products(data, form, np.array([len(data.command)]))
    gram, side, total = products[:-1, :-1], products[:-1, -1], float(products[-1, -1])
    if rows < LEAST_ROWS or total <= 0.0:
        return None
    kept = np.ones(len(side), dtype=bool)
    theta = _solved(gram, side, kept)
    if theta[0] * theta[1] < 0.0:  # a reset against the gain is none
        kept[1] = False
        kept[-1] = kept[-1] and not data.unknown
        theta = _solved(gram, side, kept)
    r_squared = float(2.0 * theta @ side - theta @ gram @ theta) / total
    return _Fit(form, rows, theta, kept, r_squared)


def _covariance(data: _Data, fit: _Fit) -> FloatArray:
    """Return the covariance of a fit by leaving out one block after the other."""
    ends = np.linspace(0, fit.rows, BLOCKS + 1).astype(int)[1:]
    products, _ = _products(data, fit.form, ends)
    grams, sides = products[:, :-1, :-1], products[:, :-1, -1]
    gram, side = grams.sum(axis=0), sides.sum(axis=0)
    without = [_solved(gram - g, side - s, fit.kept) for g, s in zip(grams, sides, strict=True)]
    about = np.array(without) - np.mean(without, axis=0)
    return np.asarray((BLOCKS - 1) / BLOCKS * about.T @ about)


def _solved(gram: FloatArray, side: FloatArray, kept: BoolArray) -> FloatArray:
    """Return the least-squares solution, shape (q,), zero where a column is not kept."""
    if not kept.all():
        theta = np.zeros(len(side))
        theta[kept] = _solved(gram[np.ix_(kept, kept)], side[kept], kept[kept])
        return theta
    scale = np.sqrt(np.maximum(gram.diagonal(), 1e-300))
    scaled = gram / (scale[:, None] * scale)
    return np.asarray(np.linalg.lstsq(scaled, side / scale, rcond=1e-12)[0] / scale)


def _told(
    fit: _Fit,
    set_point: FloatArray,
    limits: tuple[float, float],
    scales: tuple[float, float],
    data: _Data,
) -> RecoveredController:
    """Return the fit in the units of the record."""
    ratio = scales[0] / scales[1]
    wanted = [0, 1, 2] if fit.form.derivative else [0, 1]
    coefficients, covariance = np.zeros(3), np.zeros((3, 3))
    coefficients[wanted] = fit.theta[wanted] * ratio
    found = _covariance(data, fit)
    covariance[np.ix_(wanted, wanted)] = found[np.ix_(wanted, wanted)] * ratio**2
    if data.unknown and fit.theta[1] != 0.0:
        shift = float(fit.theta[-1] / fit.theta[1])
        set_point = set_point + np.clip(shift, -1.0, 1.0) * scales[1]
    believed = fit.r_squared >= LEAST_FIT
    status = ControllerStatus.OK if believed else ControllerStatus.NO_RELATION
    reason = "" if believed else f"a PI law explains {fit.r_squared:.2f} of the moves of OP"
    form = fit.form
    return RecoveredController(
        status,
        reason,
        set_point,
        limits,
        coefficients,
        covariance,
        form.lag,
        form.smoothing,
        form.span,
        fit.r_squared,
    )


@compiled
def smoothed(values: FloatArray, share: float) -> FloatArray:
    """Return ``values``, shape (N,), behind a filter that keeps ``share`` of its last value."""
    out = np.empty(len(values))
    kept = share * values[0]
    for k in range(len(values)):
        out[k] = kept + (1.0 - share) * values[k]
        kept = share * out[k]
    return out


def _spread(values: FloatArray) -> float:
    return float(values.std()) if len(values) else 0.0


def resting_limits(op: FloatArray) -> tuple[float, float]:
    """Return where OP rests at the ends of its range, infinite where it does not.

    A coarse step also lets OP rest at an end: then it takes few values.
    """
    limits = [-np.inf, np.inf]
    if len(op) < LEAST_ROWS or len(np.unique(op)) < CLIPPED_LEVELS:
        return limits[0], limits[1]
    longest = _longest_run(np.diff(op[(op > op.min()) & (op < op.max())]) == 0.0)
    for side, end in enumerate((float(op.min()), float(op.max()))):
        run = _longest_run(op == end)
        if run >= max(CLIPPED_RUN, 3 * (longest + 1)):
            limits[side] = end
    return limits[0], limits[1]


def _longest_run(there: BoolArray) -> int:
    begins, ends = holds.stretches(there)
    return int((ends - begins).max(initial=0))
