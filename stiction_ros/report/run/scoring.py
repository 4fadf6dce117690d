"""How well a loop keeps its set-points, and what a swap of controllers changed.

Everything is computed from the error e = PV − SP inside the *holds*: the stretches of samples
between two moves of any set-point.

- *Amplitude*: √2 × RMS of the spectral line at the dominant period of the phase `before`.
- *Offset*: mean over the holds of |mean e| over their last 50 samples. Holds of fewer than
  100 samples have not settled by then and do not count, unless all are shorter.
- *Work* of each valve per hour, and the largest move of its OP from one sample to the next.
- *IAE per hour*: ∫|e|dt per hour, minus the share of white measurement noise, E|v| = √(2/π) σ ≈
  0.798 σ. With time in hours on both sides that is mean |e| − 0.798 σ, in PV units × h per h.
"""

import dataclasses
import enum
from collections.abc import Mapping, Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records import Record
from stiction_ros.records.record import Quality
from stiction_ros.records.valve_work import ValveWork, largest_op_step, work_per_hour
from stiction_ros.signals import oscillation
from stiction_ros.signals.holds import holds

OFFSET_SAMPLES = 50
NOISE_SHARE = float(np.sqrt(2 / np.pi))  # E|v| of white noise with σ = 1
MOST_MISSING = 0.5  # share of the samples of a phase that may be missing in the record


class PhaseStatus(enum.StrEnum):
    """Whether the phases could be compared."""

    OK = "ok"
    NO_SWAP = "no_swap"
    NO_ROUND = "no_round"
    NO_CYCLE = "no_cycle"


@dataclasses.dataclass(frozen=True)
class Score:
    """How one output behaved during one phase, in its engineering units."""

    # of the spectral line at the dominant period; None when no hold is long enough to measure it or
    # there is no period
    amplitude: float | None
    offset: float  # |mean error| at the end of the holds
    iae_per_hour: float  # mean |error| less the share of known noise, PV units × h per h


@dataclasses.dataclass(frozen=True)
class Phase:
    """A stretch of samples, and what it is measured by."""

    first: int  # first, last: its samples, the last one not included
    last: int
    scores: Mapping[str, Score]  # by output
    work: Mapping[str, ValveWork]  # of each valve per hour; empty where the stems are unknown
    op_step: Mapping[str, float]  # largest move of each OP from one sample to the next, by valve, %


@dataclasses.dataclass(frozen=True)
class Phases:
    """The rounds of the schedule before and after the swap, scored alike."""

    status: PhaseStatus  # ok, or why the two cannot be compared
    reason: str  # one sentence; empty when ok
    cycle: oscillation.Cycle | None  # of ``before``, None when it could not be looked for
    before: Phase | None  # before, after: None where there is no whole round
    after: Phase | None


def offset(error: FloatArray, stretches: Sequence[tuple[int, int]]) -> float:
    """Return the mean over holds of |mean error| over the last 50 samples of each."""
    long_enough = [(a, b) for a, b in stretches if b - a >= 2 * OFFSET_SAMPLES]
    ends = [error[max(b - OFFSET_SAMPLES, a) : b] for a, b in long_enough or stretches]
    return float(np.mean([abs(float(end.mean())) for end in ends]))


def iae_per_hour(error: FloatArray, noise_std: float = 0.0) -> float:
    """Return ∫|e|dt per hour less the share 0.798 σ of white measurement noise."""
    return float(np.abs(error).mean()) - NOISE_SHARE * noise_std


def score(
    record: Record, first: int, last: int, period: float | None, noise_std: Sequence[float]
) -> Phase:
    """Score every output over samples ``first`` up to, not including, ``last``.

    Without set-points the mean of each PV stands in, without a period, samples, amplitudes are left
    out; ``noise_std`` is σ of the measurement noise of each output where known, else 0.
    """
    part = record.part(first, last)
    there = part.quality != Quality.BAD
    error, stretches = errors(part)
    return Phase(
        first,
        last,
        {
            name: Score(
                None if period is None else oscillation.amplitude(error[:, j], stretches, period),
                offset(error[:, j], stretches),
                iae_per_hour(error[there, j], noise_std[j]),
            )
            for j, name in enumerate(record.outputs)
        },
        work_per_hour(part),
        largest_op_step(part),
    )


def errors(record: Record) -> tuple[FloatArray, list[tuple[int, int]]]:
    """Return PV − SP, shape (N, p), and the holds; without SP deviations from the mean.

    A sample that is missing in the record has the error 0 and is in no hold.
    """
    there = record.quality != Quality.BAD
    error = record.pv - (record.pv[there].mean(axis=0) if record.sp is None else record.sp)
    error[~there] = 0.0
    stretches = record.usable_rows(set(Quality) - {Quality.BAD})
    if record.sp is None:
        return error, stretches
    return error, [(a + f, a + b) for a, z in stretches for f, b in holds(record.sp[a:z])]


def phases(
    record: Record,
    swap: int | None,
    round_samples: int | None,
    noise_std: Sequence[float] | None = None,
) -> Phases:
    """Score the last whole round before the swap and the first whole one after it.

    Rounds are counted from the first sample. Without a repeating schedule everything before
    the swap is set against everything after it, which the caller should say. Without a swap the
    last whole round is scored alone, or all of a record that has none.
    """
    sigma = [0.0] * len(record.outputs) if noise_std is None else list(noise_std)
    swapped = swap is not None and 0 < swap < len(record)
    end = swap if swap is not None and swapped else len(record)
    first, last, again, behind = 0, end, end, len(record)
    if round_samples is not None and (swapped or end >= round_samples):
        first, last = (end // round_samples - 1) * round_samples, end - end % round_samples
        again = -(-end // round_samples) * round_samples
        behind = again + round_samples
    status = PhaseStatus.NO_ROUND if swapped else PhaseStatus.NO_SWAP
    never = "the controller was never swapped"
    if first < 0:
        reason = f"the swap at sample {swap} came before the first round of set-points ended"
        return Phases(status, reason, None, None, None)
    if _gap(record, first, last):
        reason = "the record has a gap in the last round of set-points before the swap"
        if not swapped:
            reason = f"{never}, and most of its last round of set-points is missing in the record"
        return Phases(status, reason, None, None, None)
    cycle = oscillation.dominant_cycle(*errors(record.part(first, last)))
    period = None if cycle is None else cycle.period
    before = score(record, first, last, period, sigma)
    reason = "" if swapped else never
    if swapped and behind > len(record):
        reason = "the record ends before one whole round of set-points after the swap"
    elif swapped and _gap(record, again, behind):
        reason = "the record has a gap in the first round of set-points after the swap"
    if reason:
        return Phases(status, reason, cycle, before, None)
    after = score(record, again, behind, period, sigma)
    reason = _no_cycle(cycle)
    status = PhaseStatus.NO_CYCLE if reason else PhaseStatus.OK
    return Phases(status, reason, cycle, before, after)


def _gap(record: Record, first: int, last: int) -> bool:
    """Tell whether too much is missing in a phase to score it."""
    missing = record.quality[first:last] == Quality.BAD
    return bool(missing.mean() > MOST_MISSING)


def _no_cycle(cycle: oscillation.Cycle | None) -> str:
    """Return why there is no limit cycle to judge by; empty when there is one."""
    if cycle is None or cycle.share < oscillation.LEAST_LINE:
        return "the loop did not cycle in the last round of set-points before the swap"
    if cycle.count < oscillation.NEEDED_CYCLES:
        return (
            f"the loop made {cycle.count} whole cycles in the last round of set-points before "
            f"the swap, at least {oscillation.NEEDED_CYCLES} are needed"
        )
    return ""
