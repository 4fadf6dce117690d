"""How the controllers of the Example 2 study did: scores of one run, and means over seeds."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records.valve_work import ValveWork, largest_op_step
from stiction_ros.report.run.scoring import offset
from stiction_ros.signals.holds import holds
from stiction_ros.signals.oscillation import LEAST_LINE, amplitude, dominant_cycle
from stiction_studies.examples.control_study import COLUMNS, ColumnRun, Trial


@dataclasses.dataclass(frozen=True)
class OutputScore:
    """One output, from its noise-free error over all samples.

    Attributes:
        iae: ∫|PV − SP| dt, PV units × min.
        ise: ∫(PV − SP)² dt, PV units² × min.
        offset: mean |mean error| over the last 50 samples of the holds.
        amplitude: of the spectral line at the period of the unaware controller's cycle; NaN
            where that one has no cycle or no hold is long enough.
    """

    iae: float
    ise: float
    offset: float
    amplitude: float


@dataclasses.dataclass(frozen=True)
class ValveScore:
    """One valve: the work of its stem, and the largest move of its OP in a sample, %."""

    travel: float
    moves: float
    reversals: float
    op_step: float


@dataclasses.dataclass(frozen=True)
class ColumnScore:
    """One controller.

    Attributes:
        outputs, valves: by tag.
        median_ms, p99_ms: of its steps.
        from_warm_start: share of steps at which the warm start beat the programme; NaN for
            controllers without one.
    """

    outputs: Mapping[str, OutputScore]
    valves: Mapping[str, ValveScore]
    median_ms: float
    p99_ms: float
    from_warm_start: float

    def to_dict(self) -> dict[str, Any]:
        """Return nested mappings."""
        return dataclasses.asdict(self)


def score_trial(trial: Trial) -> dict[str, ColumnScore]:
    """Return the scores of what ran by column key; amplitudes at the period of its unaware cycle.

    Without an unaware run there are none.
    """
    unaware = trial.runs.get("unaware")
    period = None if unaware is None else cycle_period(unaware)
    keys = (column.key for column in COLUMNS if column.key in trial.runs)
    return {key: _score(trial.runs[key], period) for key in keys}


def cycle_period(run: ColumnRun) -> float | None:
    """Return the period of the limit cycle, samples; None when there is none to speak of."""
    error, stretches = _errors(run)
    cycle = dominant_cycle(error, stretches)
    return None if cycle is None or cycle.share < LEAST_LINE else cycle.period


def mean_score(scores: Sequence[ColumnScore]) -> ColumnScore:
    """Return the mean over seeds of every figure, those left out that are NaN."""
    first = scores[0]
    outputs = {
        tag: OutputScore(*_means([score.outputs[tag] for score in scores])) for tag in first.outputs
    }
    valves = {
        tag: ValveScore(*_means([score.valves[tag] for score in scores])) for tag in first.valves
    }
    rest = [(score.median_ms, score.p99_ms, score.from_warm_start) for score in scores]
    return ColumnScore(outputs, valves, *_mean_rows(np.array(rest)))


def _score(run: ColumnRun, period: float | None) -> ColumnScore:
    record = run.run.record
    assert record.stem is not None
    error, stretches = _errors(run)
    minutes = record.sample_time / 60.0
    outputs = {}
    for i, tag in enumerate(record.outputs):
        line = None if period is None else amplitude(error[:, i], stretches, period)
        outputs[tag] = OutputScore(
            float(np.abs(error[:, i]).sum()) * minutes,
            float((error[:, i] ** 2).sum()) * minutes,
            offset(error[:, i], stretches),
            float("nan") if line is None else line,
        )
    steps = largest_op_step(record)
    valves = {
        tag: ValveScore(**vars(ValveWork.of(record.stem[:, j])), op_step=steps[tag])
        for j, tag in enumerate(record.valves)
    }
    median, last = np.median(run.times), np.percentile(run.times, 99)
    share = float(np.mean(run.from_start)) if run.from_start else float("nan")
    return ColumnScore(outputs, valves, float(median), float(last), share)


def _errors(run: ColumnRun) -> tuple[FloatArray, list[tuple[int, int]]]:
    record = run.run.record
    assert record.sp is not None
    return run.run.pv_clean - record.sp, holds(record.sp)


def _means(parts: Sequence[Any]) -> list[float]:
    return _mean_rows(np.array([dataclasses.astuple(part) for part in parts]))


def _mean_rows(rows: FloatArray) -> list[float]:
    """Return the mean of each column over its finite entries; NaN where there is none."""
    finite = np.isfinite(rows)
    counts = finite.sum(axis=0)
    sums = np.where(finite, rows, 0.0).sum(axis=0)
    return [float(s / c) if c else float("nan") for s, c in zip(sums, counts, strict=True)]
