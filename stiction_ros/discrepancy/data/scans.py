"""A controller that scans again between two samples of the record: the OP that was not recorded."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.measures import OUTLYING, TURNS
from stiction_ros.discrepancy.simulation.free_run import FEWEST, Runs
from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.loop import LoopModel

LIKE_PV = (0.15, 2.0)  # times the spread of PV about its neighbours; a quarter where it is smooth


@dataclasses.dataclass(frozen=True)
class Scans:
    r"""What a PI law gives that scans twice in a sample, h = T_s / 2.

    .. math::
        u_{k+1/2} &= u_k + K [(e_{k+1/2} - e_k) + (h / T_i) e_{k+1/2}] \\
        u_{k+1} &= u_{k+1/2} + K [(e_{k+1} - e_{k+1/2}) + (h / T_i) e_{k+1}]

    Both together hold the error between two samples once: the record tells it, and with it the OP.
    """

    gain: float  # gain, integral_time: of the controller, by the recorded moves of OP
    integral_time: float
    op: FloatArray  # mean of the OPs of each sample, %, shape (N, 1)

    def each(self, recorded: FloatArray) -> FloatArray:
        """Return the OPs of both scans of each sample, shape (2 N, 1), the recorded one first."""
        both = np.stack([recorded, 2.0 * self.op - recorded], axis=1)
        return np.asarray(both.reshape(-1, recorded.shape[1]))


def scanned_twice(model: LoopModel, runs: Runs) -> Scans | None:
    """Return the law of a controller that scans twice in a sample; None where none is seen.

    Its error between two samples has to lie about those of its neighbours as PV itself does about
    its own, by the recorded tuning or by the one that gives the moves of OP best. By a law that
    scans once it is, but for rounding, their mean or the later one.

    Args:
        model: of a loop with one valve and one output.
        runs: records with SP.
    """
    low, high = model.limits[0]
    h = 0.5 * runs.sample_time
    parts = _parts(model, runs)
    if sum(int(np.isfinite(part.moves).sum()) for part in parts) < FEWEST:
        return None
    laws = [_fitted(parts)]
    if model.controller is not None:
        recorded = model.controller
        laws.insert(0, (recorded.gain, recorded.gain * h / recorded.integral_time))
    usual = float(np.median(np.abs(np.concatenate([np.diff(p.error, 2) for p in parts])))) / 2.0
    for gain, integral in laws:
        if integral == 0.0 or gain / integral <= 0.0:
            continue
        away = [part.away(gain, integral) for part in parts]
        once = [a - 0.5 * np.diff(part.error) for part, a in zip(parts, away, strict=True)]
        between = min(float(np.nanmedian(np.abs(np.concatenate(each)))) for each in (away, once))
        if LIKE_PV[0] * usual < between < LIKE_PV[1] * usual:
            mean = [
                part.mean_op(a, gain, integral, (low, high))
                for part, a in zip(parts, away, strict=True)
            ]
            return Scans(gain, gain * h / integral, np.concatenate(mean)[:, None])
    return None


def _parts(model: LoopModel, runs: Runs) -> "list[_Part]":
    low, high = model.limits[0].tolist()
    return [
        _Part.of(runs.op[rows, 0], error, (low, high))
        for rows, error in zip(runs.slices, errors_of(model, runs), strict=True)
    ]


def _fitted(parts: "Sequence[_Part]") -> tuple[float, float]:
    """Return K and K h / T_i, the errors between samples on a cubic through four.

    They are not where SP has moved: such samples are not asked. Noise on the four does not bias the
    figures, as an error before them is the instrument.
    """
    moves = np.concatenate([part.moves for part in parts])
    change = np.concatenate([np.diff(part.error) for part in parts])
    error = np.concatenate([part.error[1:] + between_samples(part.error) for part in parts])
    usual = float(np.median(np.abs(change)))
    rests = np.concatenate([_rests(part.error, OUTLYING * usual) for part in parts])
    asked = np.isfinite(moves) & rests
    if not asked.any():
        return 0.0, 0.0
    before = np.concatenate([np.pad(part.error, (2, 0), mode="edge")[:-3] for part in parts])
    columns, instruments = np.column_stack([change, error]), np.column_stack([change, before])
    for _ in range(TURNS):
        known = instruments[asked].T
        figures = np.linalg.lstsq(known @ columns[asked], known @ moves[asked])[0]
        left = np.abs(moves - columns @ figures)
        asked &= left <= OUTLYING * float(np.median(left[asked]))
    return float(figures[0]), float(figures[1])


def between_samples(values: FloatArray) -> FloatArray:
    """Return values half-way between samples, on a cubic through four, shape (N − 1, …)."""
    mean = 0.5 * (values[1:] + values[:-1])
    mean[1:-1] += (mean[1:-1] - 0.5 * (values[3:] + values[:-3])) / 8.0
    return np.asarray(mean)


def _rests(error: FloatArray, most: float) -> BoolArray:
    """Return where neither a change of the error nor its neighbours are moves of SP."""
    small = np.pad(np.abs(np.diff(error)) <= most, 1, constant_values=True)
    return np.asarray(small[1:-1] & small[2:] & small[:-2])


@dataclasses.dataclass(frozen=True)
class _Part:
    """One record."""

    op: FloatArray  # op, error: shape (N,)
    error: FloatArray
    moves: FloatArray  # of OP, NaN where it is at a limit, shape (N − 1,)

    @classmethod
    def of(cls, op: FloatArray, error: FloatArray, limits: tuple[float, float]) -> "_Part":
        """Return a record, its moves between limits alone."""
        inside = (op > limits[0]) & (op < limits[1])
        return cls(op, error, np.where(inside[1:] & inside[:-1], np.diff(op), np.nan))

    def away(self, gain: float, integral: float) -> FloatArray:
        """Return how far each error between two samples lies off their mean, by K and K h / T_i."""
        mean = 0.5 * (self.error[1:] + self.error[:-1])
        left = self.moves - gain * np.diff(self.error) - integral * (self.error[1:] + mean)
        return np.asarray(left / integral)

    def mean_op(
        self, away: FloatArray, gain: float, integral: float, limits: tuple[float, float]
    ) -> FloatArray:
        """Return the mean OP of each sample, shape (N,).

        Where a limit hides how far the error lies off the mean, it is taken to lie on it.
        """
        middle = 0.5 * (self.error[1:] + self.error[:-1]) + np.nan_to_num(away)
        later = self.op[:-1] + gain * (middle - self.error[:-1]) + integral * middle
        mean = self.op.copy()
        mean[:-1] = 0.5 * (self.op[:-1] + np.clip(later, *limits))
        return mean


def errors_of(model: LoopModel, runs: Runs, shift: int = 0) -> list[FloatArray]:
    """Return SP − PV of each record, shape (n − shift,), where PV is ``shift`` samples late."""
    found = []
    for record, rows in zip(runs.records, runs.slices, strict=True):
        assert record.sp is not None
        late = runs.pv[rows, 0][shift:]
        found.append(record.sp[: len(late), record.outputs.index(model.outputs[0])] - late)
    return found


def law_terms(error: FloatArray, sample_time: float) -> FloatArray:
    """Return (e_k − e_{k−1}, T_s e_k) from the second sample on, shape (n, 2)."""
    return np.column_stack([np.diff(error), sample_time * error[1:]])
