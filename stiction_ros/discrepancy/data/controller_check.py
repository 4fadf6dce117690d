"""OP recomputed from PV and SP: was the recorded controller at work, on the recorded clock?"""

import dataclasses
import enum
import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from stiction_ros.discrepancy.data.filled import FLOAT
from stiction_ros.discrepancy.data.gate import DataFinding, quantum_of
from stiction_ros.discrepancy.data.scans import Scans, errors_of, law_terms, scanned_twice
from stiction_ros.discrepancy.data.set_point import told_set_points
from stiction_ros.discrepancy.likelihood.declared_noise import Unseen
from stiction_ros.discrepancy.measures import (
    ALONG,
    LARGER,
    LONGEST_DELAY,
    NEARLY_ALL,
    NEGLIGIBLE,
    NORMAL_OF_MEDIAN,
    SLIGHT,
    TRACE,
)
from stiction_ros.discrepancy.simulation.free_run import Runs
from stiction_ros.effects import FloatArray, TimeShift, Tuning
from stiction_ros.loop import LoopModel, PiTuning

MANY = 0.2  # of the samples: where OP moves less often, somebody moves it


class ControllerStatus(enum.StrEnum):
    """How OP and a PI law agree.

    ``SAME``: OP is what the recorded tuning gives. ``OTHER``: another tuning or another
    clock gives it. ``UNEXPLAINED``: no PI law gives it. ``NOT_ASKED``: SP is not recorded,
    or the loop is no single one.
    """

    SAME = "same"
    OTHER = "other"
    UNEXPLAINED = "unexplained"
    NOT_ASKED = "not_asked"


@dataclasses.dataclass(frozen=True)
class ControllerCheck:
    """What recomputing OP shows."""

    status: ControllerStatus  # see ``ControllerStatus``
    finding: DataFinding | None  # another tuning or a time shift
    left: float  # share of the moves of OP that the best PI law leaves, 0 to 1
    clock_known: bool  # whether the record's clock of PV against OP is shown to be right
    # of a controller that scans twice in a sample of the record; None of one that does not, or
    # whose OP between the samples is not told
    scans: Scans | None = None
    # how far OP is off that was told by a law whose SP was not recorded
    unsure: Unseen | None = None
    # whether OP is rounded and no tuning known: it may be another between the samples
    between: bool = False


NOT_ASKED = ControllerCheck(ControllerStatus.NOT_ASKED, None, 1.0, False)


def unseen_of(runs: Runs, check: ControllerCheck) -> tuple[tuple[Unseen, ...], ...]:
    """Return per valve what may act beside the recorded OP.

    A rounded OP is off by up to half a step: by another amount at each sample where it moves at
    many, and by one amount until the next move where somebody moves it. Values that somebody
    chose are what they are, unless they lie finer than anybody chooses them. A controller that
    scans again between two samples holds another OP for half of them, which lies off the mean of
    its neighbours as far as a recorded one does off that of its own; that is asked only where no
    PI law gives the recorded OP, rounding hides that law, or SP is not recorded.

    Args:
        runs: the records.
        check: of the controller.
    """
    asked = _in_doubt(runs, check)
    found = []
    for op in runs.op.T:
        moves = np.concatenate([np.diff(op[rows]) for rows in runs.slices])
        often = float(np.mean(moves != 0.0))
        quantum = quantum_of(op) if often > MANY else _chosen(op)
        keep = 1.0 - often if often <= MANY else _kept(op, runs.slices)
        beside = [Unseen(quantum**2 / 12.0, keep)] if quantum > 0.0 else []
        beside += [] if check.unsure is None else [check.unsure]
        # an OP that is not rounded, and yet rests, is no controller's that scans between samples
        if asked and often > (MANY if quantum > 0.0 else NEARLY_ALL):
            bends = np.concatenate([0.5 * np.diff(op[rows], 2) for rows in runs.slices])
            spread = (NORMAL_OF_MEDIAN * float(np.median(np.abs(bends)))) ** 2 - quantum**2 / 8.0
            beside.append(Unseen(max(0.25 * spread, 0.0)))  # it is held for half a sample
        found.append(tuple(beside))
    return tuple(found)


def _in_doubt(runs: Runs, check: ControllerCheck) -> bool:
    """Tell whether a controller may have scanned again between samples, which no law shows."""
    untold = any(record.sp is None for record in runs.records)
    given = check.status in (ControllerStatus.NOT_ASKED, ControllerStatus.OTHER) and not untold
    return check.between or (not given and check.left > NEGLIGIBLE and check.scans is None)


def _kept(op: FloatArray, slices: Sequence[slice]) -> float:
    """Return the correlation of what rounding hides of an OP from sample to sample, 0 to 1.

    A move of d steps leaves 1 − 6 f (1 − f) of an even error, with f the fraction of d. Moves are
    normal, of a size by which the value changes as often as it does at that time.
    """
    normal = NormalDist()
    spread = np.array([normal.inv_cdf((k + 0.5) / ALONG) for k in range(ALONG)])
    ends = [np.flatnonzero(np.diff(op[rows], append=np.inf)) for rows in slices]
    rests = np.concatenate([np.diff(each, prepend=-1) for each in ends])
    fractions = np.abs(np.outer(math.sqrt(0.5 * math.pi) / rests, spread)) % 1.0
    left = (1.0 - 6.0 * fractions * (1.0 - fractions)).mean(axis=1)
    return float(np.clip(np.average(left, weights=rests), 0.0, 1.0))


def _chosen(values: FloatArray) -> float:
    """Return the distance of which all few values are multiples; 0 where it is no rounding.

    By Euclid: few values need not lie one step apart.
    """
    distinct = np.unique(values)
    span = float(np.ptp(values))
    quantum = 0.0
    for step in np.diff(distinct).tolist():
        while step > FLOAT * span:
            quantum, step = step, math.fmod(quantum, step)
            step = 0.0 if quantum - step <= FLOAT * span else step
    return quantum if TRACE * span < quantum <= NEGLIGIBLE * span else 0.0


def check_controller(model: LoopModel, runs: Runs) -> ControllerCheck:
    """Compare OP with a PI law.

    Where no SP is recorded it is the one that a law tells, if that law gives OP.
    """
    single = len(model.valves) == 1 and len(model.outputs) == 1
    if not single:
        return NOT_ASKED
    if all(record.sp is not None for record in runs.records):
        return _compared(model, runs)
    once, twice = (_told_by(model, runs, scans) for scans in (1, 2))
    return once if once.left <= TRACE or twice.scans is None else twice


def _told_by(model: LoopModel, runs: Runs, scans: int) -> ControllerCheck:
    """Return what the set-points show that a law of one or two scans in a sample tells.

    That law has to give OP.
    """
    told = told_set_points(model, runs, scans)
    if told is None:
        return NOT_ASKED
    check = _compared(dataclasses.replace(model, controller=told.tuning), told.runs)
    if check.status is not ControllerStatus.SAME:
        return NOT_ASKED
    if check.scans is None:
        return check if check.left <= NEGLIGIBLE else NOT_ASKED
    error = check.scans.gain * told.error
    return dataclasses.replace(check, unsure=Unseen(error**2, 1.0 - 1.0 / told.rest))


def _compared(model: LoopModel, runs: Runs) -> ControllerCheck:
    r"""Compare the moves of OP with :math:`K [(e_k - e_{k-1}) + (T_s/T_i) e_k]`.

    Without a recorded tuning, gain and integral time are fitted: then only the clock can be
    checked. Samples at which OP rests at a limit are left out.
    """
    laws = [_law(model, runs, shift) for shift in range(LONGEST_DELAY + 1)]
    scans = _scans(model, runs, laws[0])
    if scans is not None:
        return ControllerCheck(ControllerStatus.SAME, None, laws[0].left, False, scans)
    best = min(range(len(laws)), key=lambda shift: laws[shift].left * (1.0 + 1e-3 * shift))
    recorded = model.controller
    own = math.inf if recorded is None else _law(model, runs, tuning=recorded).left
    as_well = math.isfinite(own) and own <= 2.0 * laws[0].left
    if (
        recorded is not None
        and best == 0
        and (as_well or (own <= NEGLIGIBLE and _alike(recorded, laws[0])))
    ):
        known = laws[0].left < NEGLIGIBLE
        return ControllerCheck(ControllerStatus.SAME, None, own, known)
    law = laws[best]
    if law.left > max(NEGLIGIBLE, LARGER * _rounding(runs, law)):
        return ControllerCheck(ControllerStatus.UNEXPLAINED, None, law.left, False)
    if recorded is None and best == 0:
        rounded = quantum_of(runs.op[:, 0]) > 0.0
        return ControllerCheck(ControllerStatus.SAME, None, law.left, True, between=rounded)
    if best > 0:
        before = own if math.isfinite(own) else laws[0].left
        finding = _finding(TimeShift(float(best)), before, law)
    else:
        assert recorded is not None
        if _alike(recorded, law):
            return ControllerCheck(ControllerStatus.SAME, None, own, False)
        finding = _finding(Tuning(law.gain, law.integral_time), own, law)
    return ControllerCheck(ControllerStatus.OTHER, finding, law.left, True)


@dataclasses.dataclass(frozen=True)
class _Law:
    """A PI law as the moves of OP show it."""

    gain: float  # gain, integral_time: of the controller
    integral_time: float
    left: float  # share of the moves that it leaves
    samples: int  # how many moves there are
    usual: float = 0.0  # their root mean square, %


def _scans(model: LoopModel, runs: Runs, law: _Law) -> Scans | None:
    """Return the law of a controller that scans twice, where one scan does not give OP."""
    if law.left <= max(LARGER * _rounding(runs, law), TRACE):
        return None
    found = scanned_twice(model, runs)
    if found is None or model.controller is None or _alike(model.controller, found):
        return found
    return None


def _alike(recorded: PiTuning, law: _Law | Scans) -> bool:
    """Tell whether two tunings differ by less than matters."""
    ratios = law.gain / recorded.gain, law.integral_time / recorded.integral_time
    return all(1.0 / (1.0 + SLIGHT) < ratio < 1.0 + SLIGHT for ratio in ratios)


def _finding(behaviour: Tuning | TimeShift, before: float, law: _Law) -> DataFinding:
    """Return what is wrong, by the shares of the moves of OP that are left without and with it."""
    ratio = max(before, 1e-6) / max(law.left, 1e-6)
    gain = 2.0 * law.samples * math.log(max(ratio, 1.0)) - 2.0 * math.log(max(law.samples, 2))
    return DataFinding("data", behaviour, gain)


def _regression(model: LoopModel, runs: Runs, shift: int) -> tuple[FloatArray, FloatArray]:
    """Return the moves of OP, shape (n,), and (e_k − e_{k−1}, T_s e_k), shape (n, 2).

    Moves to or from a sample that was carried over or drawn in, by whoever made the record or by a
    historian, say nothing of a law.
    """
    low, high = model.limits[0]
    moves, columns = [], []
    errors = errors_of(model, runs, shift)
    for record, rows, error in zip(runs.records, runs.slices, errors, strict=True):
        op, count = runs.op[rows, 0], len(error)
        if count < 2:
            continue
        told = record.measured[1:] & record.measured[:-1]
        known = told & ~(runs.filled[0, rows][1:] | runs.filled[0, rows][:-1])
        told = told[: count - 1] & known[shift:]
        inside = (op[1:count] > low) & (op[1:count] < high) & told
        moves.append(np.diff(op[:count])[inside])
        columns.append(law_terms(error, runs.sample_time)[inside])
    if not moves:
        return np.zeros(0), np.zeros((0, 2))
    return np.concatenate(moves), np.vstack(columns)


def _law(model: LoopModel, runs: Runs, shift: int = 0, tuning: PiTuning | None = None) -> _Law:
    """Return a recorded law, or without one that of least squares; inf is left where OP rests."""
    moves, columns = _regression(model, runs, shift)
    if not np.any(moves) or (tuning is None and len(moves) < 10):
        return _Law(0.0, 1.0, math.inf, len(moves))
    if tuning is None:
        gain, integral = np.linalg.lstsq(columns, moves, rcond=None)[0].tolist()
    else:
        gain, integral = tuning.gain, tuning.gain / tuning.integral_time
    left = moves - columns @ np.array([gain, integral])
    share = float(np.linalg.norm(left) / np.linalg.norm(moves))
    time = gain / integral if integral != 0.0 and gain / integral > 0.0 else 1e9
    usual = float(np.sqrt(np.mean(moves**2)))
    return _Law(gain, min(time, 1e9), share, len(moves), usual)


def _rounding(runs: Runs, law: _Law) -> float:
    """Return what rounded values of PV and OP leave of the moves of OP under a law that is true."""
    pv, op = runs.lattices[0], quantum_of(runs.op[:, 0])
    now = law.gain * (1.0 + runs.sample_time / law.integral_time)
    variance = ((now**2 + law.gain**2) * pv**2 + 2.0 * op**2) / 12.0
    return math.sqrt(variance) / law.usual if law.usual > 0.0 else 0.0
