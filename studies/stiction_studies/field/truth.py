"""What is true of a loop of the field, found by experiment."""

import dataclasses
import enum
import itertools
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from stiction_studies.field.kernels import FloatArray
from stiction_studies.field.valves import Ramped

EVEN = 0.1  # share of the band below which a jump counts as none
MOVES = 1e-3  # share of the band by which a stem moves at least in a scan
SLIP = 0.25  # share of the jump that a slip has at least
TURN = 0.05  # share of the band by which a stem turns back at least
SHARE = 0.6  # of a swing that is left, at least, without a thing that did not cause it
CROSSINGS = 6  # zero crossings of the autocorrelation that a regular cycle has at least
WANDERING = 0.05  # of the record, that stands for the period of what has none
REGULAR = 1.0  # regularity above which a cycle is one


class ValveKind(enum.StrEnum):
    """What a valve is."""

    STICKY = "sticky"
    BACKLASH = "backlash"
    HEALTHY = "healthy"


class Cause(enum.StrEnum):
    """What makes a loop cycle."""

    VALVE = "valve"
    TUNING = "tuning"
    DISTURBANCE = "disturbance"
    SET_POINT = "set_point"
    NONE = "none"


@dataclasses.dataclass(frozen=True)
class Truth:
    """The answer to one loop; %, where it says so, in the record's unit of OP.

    Attributes:
        valve: sticky, backlash, or healthy: with less friction than matters.
        law: word of the friction law.
        band: width between the directions of a slow triangle, %.
        jump: median size of a slip on it, %; 0 where the stem moves on evenly.
        f_s, f_d: parameters of He's law, %; None for the others.
        slip_rows: sample of the record at which each slip begins.
        reversals: how often the stem turned.
        causes: of the cycle; any of them is right.
        band_share: band over OP's range.
    """

    valve: ValveKind
    law: str
    band: float
    jump: float
    f_s: float | None
    f_d: float | None
    slip_rows: tuple[int, ...]
    reversals: int
    causes: frozenset[Cause]
    band_share: float

    @property
    def slips(self) -> int:
        """How often the stem slipped; of an even motion, how often it set out in a direction."""
        return len(self.slip_rows)

    def slips_between(self, first: int, last: int) -> int:
        """Return the slips in samples ``first`` up to, not including, ``last``."""
        return sum(first <= row < last for row in self.slip_rows)


def slips(stem: FloatArray, shown: Ramped) -> tuple[list[int], int]:
    """Return where slips begin, and how often the stem turned.

    A slip is a run of moves in one direction of at least a quarter of the jump; of a valve that
    moves on evenly, a way between two turns.

    Args:
        stem: positions at the scans, %, shape (K,).
        shown: what a slow triangle shows of the valve.
    """
    if shown.band <= 0.0:
        return [], 0
    turns = _turns(stem, TURN * shown.band)
    if shown.jump < EVEN * shown.band:
        return turns, max(len(turns) - 1, 0)
    moves = np.diff(stem)
    way = np.sign(np.where(np.abs(moves) > MOVES * shown.band, moves, 0.0))
    edges = np.flatnonzero(np.diff(np.concatenate([[0.0], way, [0.0]])) != 0.0)
    starts: list[int] = []
    ways: list[float] = []
    for first, last in itertools.pairwise(edges.tolist()):
        if way[first] != 0.0 and abs(moves[first:last].sum()) >= SLIP * shown.jump:
            starts.append(first)
            ways.append(float(way[first]))
    return starts, int(np.count_nonzero(np.diff(ways)))


def _turns(stem: FloatArray, least: float) -> list[int]:
    """Return where the stem sets out in another direction, the first way included."""
    starts: list[int] = []
    way, extreme, at = 0, float(stem[0]), 0
    for k, value in enumerate(stem.tolist()):
        gone = value - extreme
        if way == 0 or gone * way < 0.0:
            if abs(gone) > least:
                way = 1 if gone > 0.0 else -1
                starts.append(at)
                extreme, at = value, k
            continue
        if gone != 0.0:
            extreme, at = value, k
    return starts


def regularity(values: FloatArray) -> tuple[float, float]:
    r"""Return regularity and period, in samples, of what zero crossings of the ACF show.

    .. math:: r = \bar T / (3 \sigma_T)

    over the times between the crossings of the first half of the lags; 0 and NaN where there
    are too few.

    References:
        N. F. Thornhill, B. Huang, H. Zhang: Detection of multiple oscillations in control
        loops. J. Process Control 13, 2003, 91-100.
    """
    count = len(values)
    row = np.arange(count) - 0.5 * (count - 1)
    level = values - values.mean()
    level = level - row * float(row @ level) / float(row @ row)
    size = 1 << (2 * count - 1).bit_length()
    spectrum = np.fft.rfft(level, size)
    acf = np.fft.irfft(np.abs(spectrum) ** 2, size)[: count // 2]
    crossings = np.flatnonzero(np.diff(np.signbit(acf)))
    times = np.diff(crossings)
    if len(crossings) < CROSSINGS:
        return 0.0, np.nan
    times = times[: 2 * CROSSINGS]
    spread = float(times.std(ddof=1))
    mean = float(times.mean())
    return mean / (3.0 * max(spread, 1e-3 * mean)), 2.0 * mean


def swing(values: FloatArray, period: float) -> float:
    """Return the standard deviation of what is faster than two periods.

    Args:
        values: shape (N,).
        period: samples; NaN takes all.
    """
    width = int(2.0 * period) if np.isfinite(period) else len(values)
    if width >= len(values) // 2:
        return float(np.std(values))
    window = np.ones(width) / width
    slow = np.convolve(values, window, mode="valid")
    begin = width // 2
    return float(np.std(values[begin : begin + len(slow)] - slow))


class Swings(NamedTuple):
    """What is looked at for the cause: error of the loop and OP, shape (N,) each."""

    error: FloatArray
    op: FloatArray


def causes(whole: Swings, without: Mapping[Cause, Swings]) -> frozenset[Cause]:
    """Return what makes a loop swing: what its error, or its OP, does not swing without.

    Args:
        whole: of the loop.
        without: of the same loop without one thing each, that could be the cause.
    """
    regular, period = regularity(whole.error)
    if regular <= REGULAR:
        period = WANDERING * len(whole.error)

    def left(rest: Swings) -> float:
        pairs = zip(whole, rest, strict=True)
        return min(swing(b, period) / max(swing(a, period), 1e-300) for a, b in pairs)

    found = {cause for cause, rest in without.items() if left(rest) < SHARE}
    if regular > REGULAR:
        return frozenset(found or set(without) or {Cause.NONE})
    return frozenset(found | {Cause.NONE})
