r"""Can a record be worked on, and were OP and PV swapped in it?

Of a swap there are two signs; only clear ones count.

*Set-point.* PV tracks SP, OP does not: where the column called OP alone lies near SP, as
:mod:`stiction_ros.signals.tracking` tells, they are swapped.

*Controller.* A linear controller acts at once and without noise,

.. math:: \sum_{i=0}^{n} a_i u_{k-i} = \sum_{i=0}^{n} b_i y_{k-i} + c, \quad a_0, b_0 \neq 0.

With integral action :math:`\sum a_i = 0` and :math:`\sum b_i \neq 0`. A process has noise, so
this is the only exact relation in a record, and the side on which the coefficients add up to
zero belongs to OP. Where OP carries noise or is rounded or compressed, there is no exact
relation and no evidence; nor where a column follows exactly from the past, as then there is no
noise and the process may obey an exact relation of its own.
"""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.records.record import Quality, Record
from stiction_ros.signals.arx import lagged
from stiction_ros.signals.tracking import CLOSER, nearness

TOO_SHORT = "take a longer record, lower orders or a narrower delay range"
MAX_ORDER = 8
MAX_SAMPLES = 4000
WINDOWS = 60  # stretches of a record in which an exact relation is looked for
FEW = 6  # of them that are solved together
EXACT = 1e-7  # largest error of an exact relation within its stretch, in standard deviations
CLOSE = 1e-6  # the same over the whole record, where it must hold in SHARE of the samples
SHARE = 0.7
SINGULAR = 1e-10  # smallest ratio of singular values; below it the relation is not unique
AT_ONCE = 1e-3  # least share of the lag-0 coefficient in the largest one
SIDES = 100.0  # how much closer to zero the coefficients of one side must add up


def require_signals(record: Record) -> None:
    """Refuse a record with gaps, without valves or outputs, or with a signal that never moves.

    Raises:
        InputError: gaps or bad samples, no valve, no output, or a constant OP or PV.
    """
    require_tags(record)
    require_motion(record, "op", record.op, record.valves)
    require_motion(record, "pv", record.pv, record.outputs)


def require_whole(record: Record) -> None:
    """Refuse a record with gaps or bad samples."""
    if record.gaps or (record.quality == Quality.BAD).any():
        raise InputError(
            "has gaps or bad samples", where=record.name, fix="take one of its good parts"
        )


def require_tags(record: Record) -> None:
    """Refuse a record with gaps, or without valves or outputs."""
    require_whole(record)
    if not record.valves or not record.outputs:
        raise InputError("needs at least one valve and one output", where=record.name)


def require_motion(record: Record, what: str, values: FloatArray, tags: tuple[str, ...]) -> None:
    """Refuse columns, shape (N, number of tags), of which one never moves."""
    for tag, column in zip(tags, values.T, strict=True):
        if len(column) and np.ptp(column) <= 1e-9 * max(1.0, float(np.abs(column).max())):
            raise InputError(
                f"{what} of {tag} is constant",
                where=record.name,
                fix="choose a window in which the loop moves",
            )


def require_samples(record: Record, needed: int, fix: str) -> None:
    """Refuse a record of fewer than ``needed`` samples."""
    if len(record) < needed:
        raise InputError(
            f"{len(record)} samples are too few, {needed} are needed", where=record.name, fix=fix
        )


def swapped_columns(record: Record) -> str | None:
    """Return the evidence that OP and PV are swapped in one sentence, or None.

    The set-point sign needs as many valves as outputs, in the same order.
    """
    if any(not np.ptp(part) > 0.0 for part in (*record.op.T, *record.pv.T) if len(part)):
        return None
    by_set_point = _set_point_ratio(record)
    by_controller = _controller_ratio(record)
    if by_set_point is not None and by_set_point >= 1.0 / CLOSER:
        return None
    if by_controller is not None and by_controller >= SIDES:
        return None
    if by_set_point is not None:
        return (
            f"the column taken for OP lies {1.0 / max(by_set_point, 1e-9):.0f} times closer to "
            "the set-point than the one taken for PV"
        )
    if by_controller is not None:
        return (
            "the columns obey an exact controller equation whose integral action lies on the "
            "side of the column taken for PV"
        )
    return None


def refuse_swapped(record: Record, evidence: str | None) -> None:
    """Raise InputError where there is evidence that OP and PV of ``record`` are swapped."""
    if evidence is not None:
        raise InputError(
            f"OP and PV look swapped: {evidence}",
            where=record.name,
            fix="exchange the columns, as with --op V1=COLUMN --pv PV1=COLUMN",
        )


def _set_point_ratio(record: Record) -> float | None:
    """Return the ratio of distances from SP: ≤ CLOSER swapped, ≥ 1 / CLOSER not; else None."""
    if record.sp is None or len(record.valves) != len(record.outputs):
        return None
    ratios = []
    for sp, op, pv in zip(record.sp.T, record.op.T, record.pv.T, strict=True):
        if (ratio := nearness(sp, op, pv)) is not None:
            ratios.append(ratio)
        elif (ratio := nearness(sp, pv, op, alone=False)) is not None:
            ratios.append(_over(1.0, ratio))
        else:
            return None
    swapped = [ratio < 1.0 for ratio in ratios]
    if all(swapped):
        return max(ratios)
    return None if any(swapped) else min(ratios)


def _controller_ratio(record: Record) -> float | None:
    """Return Σ|b| on PV's side over Σ|a| on OP's: ≤ 1 / SIDES swapped, ≥ SIDES not; else None.

    Both sums are :func:`_share`; several relations must agree, the least clear is returned.
    """
    part = record.part(0, min(len(record), MAX_SAMPLES))
    op, pv = _scaled_changes(part.op), _scaled_changes(part.pv)
    of_op = [_exact_relation(column, pv) for column in op]
    of_pv = [_exact_relation(column, op) for column in pv]
    ratios = [_over(others, own) for own, others in filter(None, of_op)]
    ratios += [_over(own, others) for own, others in filter(None, of_pv)]
    if ratios and _follows_from_the_past(op, pv):
        return None
    if ratios and max(ratios) <= 1.0 / SIDES:
        return max(ratios)
    return min(ratios) if ratios and min(ratios) >= SIDES else None


def _scaled_changes(columns: FloatArray) -> FloatArray:
    """Return differences over their standard deviation, shape (columns, N); 0 without one.

    Differences know no set-point but its moves.
    """
    changes = np.diff(columns, axis=0)
    size = changes.std(axis=0)
    scaled = np.where(size > 0.0, changes / np.where(size > 0.0, size, 1.0), 0.0)
    return np.ascontiguousarray(scaled.T)


def _follows_from_the_past(op: FloatArray, pv: FloatArray) -> bool:
    """Tell whether a column is an exact function of earlier samples alone."""
    directions = [(column, pv) for column in op] + [(column, op) for column in pv]
    return any(
        _fit(own, others, order, least=1) is not None
        for own, others in directions
        for order in range(1, MAX_ORDER + 1)
    )


def _over(numerator: float, denominator: float) -> float:
    return numerator / max(denominator, 1e-30)


def _exact_relation(own: FloatArray, others: FloatArray) -> tuple[float, float] | None:
    """Return the exact relation of lowest order with an integrator on one side, or None.

    It is told by the :func:`_share` of either side: ``own``, the scaled changes of one column,
    shape (N,), and ``others``, those of the columns that it is computed from, shape (q, N).
    """
    if not own.any() or not others.any(axis=1).all():
        return None
    for order in range(1, MAX_ORDER + 1):
        theta = _fit(own, others, order)
        if theta is None:
            continue
        a, b = np.concatenate([[1.0], -theta[:order]]), theta[order:].reshape(-1, order + 1)
        if np.abs(b[:, 0]).max() < AT_ONCE * max(float(np.abs(b).max()), 1e-3):
            continue
        found = _share(a), max(_share(row) for row in b)
        if max(found) > SIDES * min(found):
            return found
    return None


def _share(coefficients: FloatArray) -> float:
    """Return |Σ c| / Σ |c|: 0 for the side that integrates."""
    return float(abs(coefficients.sum()) / max(float(np.abs(coefficients).sum()), 1e-300))


def _fit(own: FloatArray, others: FloatArray, order: int, least: int = 0) -> FloatArray | None:
    """Return the coefficients of an exact relation of ``order``, or None.

    They are a₁ … a_n with the sign turned, then b₀ … b_n of each other column. Where 1
    is the ``least`` lag of the others, b₀ is left out and the relation need not be unique.
    """
    count = len(own) - order
    width = max(3 * (order + len(others) * (order + 1 - least)), 30)
    if count < 2 * width:
        return None
    columns = lagged(own, range(1, order + 1), order)
    for other in others:
        columns += lagged(other, range(least, order + 1), order)
    regressors, target = np.column_stack(columns), own[order:]
    stretches = np.unique(np.linspace(0, count - width, WINDOWS).astype(int))[:, None]
    stretches = stretches + np.arange(width)
    whole = np.column_stack([regressors, target])[stretches]
    left = np.abs(np.asarray(np.linalg.qr(whole, mode="r"))[:, -1, -1])
    stretches = stretches[left <= 2.0 * EXACT * np.sqrt(width)]
    moving = target != 0.0
    if not moving.any():
        return None
    for begin in range(0, len(stretches), FEW):  # mostly the first few will do
        rows = stretches[begin : begin + FEW]
        for theta in _solutions(regressors[rows], target[rows], unique=not least):
            error = np.abs(regressors[moving] @ theta - target[moving])
            if np.mean(error < CLOSE) >= SHARE:
                return np.asarray(theta)
    return None


def _solutions(regressors: FloatArray, target: FloatArray, unique: bool) -> FloatArray:
    """Return coefficients, shape (…, q), of the stretches that they explain.

    Args:
        regressors: shape (stretches, width, q).
        target: shape (stretches, width).
        unique: whether others than these must not explain them as well.
    """
    left, singular, right = np.linalg.svd(regressors, full_matrices=False)
    kept = singular > np.finfo(float).eps * regressors.shape[1] * singular[:, :1]
    along = np.einsum("wij,wi->wj", left, target)
    along = np.where(kept, along / np.where(kept, singular, 1.0), 0.0)
    solutions = np.einsum("wji,wj->wi", right, along)
    residual = np.einsum("wij,wj->wi", regressors, solutions) - target
    explained = np.abs(residual).max(axis=1) <= EXACT
    if unique:
        explained &= singular[:, -1] > SINGULAR * singular[:, 0]
    return np.asarray(solutions[explained])
