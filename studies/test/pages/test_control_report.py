"""Scores and page of the Example 2 study, on made-up signals with known scores."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import ClosedLoopRun
from stiction_ros.records import Record
from stiction_studies.examples.control_study import COLUMNS, ColumnRun, StudyOptions, Trial
from stiction_studies.pages.control_report import PlantStudy, describe, report_study, rows_of
from stiction_studies.pages.control_scores import cycle_period, mean_score, score_trial

SAMPLES, HOLD = 480, 240


def column_run(error: FloatArray, stem: FloatArray, from_start: tuple[bool, ...]) -> ColumnRun:
    """A run of 1 min samples with one move in the middle; ``error`` of both outputs, (N,)."""
    sp = np.column_stack([np.repeat([7.5, 7.6], HOLD), np.repeat([42.0, 43.0], HOLD)])
    clean = sp + error[:, None]
    noisy = clean + 0.01 * np.random.default_rng(1).standard_normal(clean.shape)
    stems = np.column_stack([stem, np.full(SAMPLES, 50.0)])
    record = Record("study", 60.0, ("V1", "V2"), ("C", "T"), stems + 1.0, noisy, sp, stems)
    times = np.linspace(1.0, 2.0, SAMPLES)
    return ColumnRun(ClosedLoopRun(record, clean), times, from_start, {"solved": SAMPLES})


def made_up_trial(seed: int = 1) -> Trial:
    """The unaware controller cycles with amplitude 0.1 and period 30; the others are off 0.02."""
    angle = 2 * np.pi / 30.0 * np.arange(SAMPLES)
    square = 50.0 + 4.0 * np.sign(np.sin(angle + 0.1))
    runs = {}
    for column in COLUMNS:
        cycles = column.key == "unaware"
        error = 0.1 * np.sin(angle) if cycles else np.full(SAMPLES, 0.02)
        from_start = (True, False, False, False) if column.key == "printed" else ()
        stem = square if cycles else np.full(SAMPLES, 50.0)
        runs[column.key] = column_run(error, stem, from_start)
    return Trial(StudyOptions(), seed, ("V1",), runs)


SCORES = score_trial(made_up_trial())


def test_iae_ise_and_offset_are_in_minutes_and_without_noise() -> None:
    score = SCORES["exact"].outputs["C"]
    assert score.iae == pytest.approx(0.02 * SAMPLES)
    assert score.ise == pytest.approx(0.0004 * SAMPLES)
    assert score.offset == pytest.approx(0.02)


def test_a_cycle_has_its_amplitude_and_a_constant_error_none() -> None:
    assert SCORES["unaware"].outputs["T"].amplitude == pytest.approx(0.1, rel=0.02)
    assert SCORES["exact"].outputs["T"].amplitude == pytest.approx(0.0, abs=1e-9)


def test_stems_are_counted_and_measured() -> None:
    moved = SCORES["unaware"].valves["V1"]
    assert (moved.travel, moved.moves) == (8.0 * 31, 31)
    still = SCORES["exact"].valves["V1"]
    assert (still.travel, still.moves) == (0.0, 0.0)


def test_times_and_choices() -> None:
    score = SCORES["printed"]
    assert (score.median_ms, score.from_warm_start) == (pytest.approx(1.5), 0.25)
    assert score.p99_ms == pytest.approx(1.99, abs=1e-3)
    assert math.isnan(SCORES["exact"].from_warm_start)


def test_a_loop_that_rests_has_no_period() -> None:
    quiet = np.random.default_rng(3).normal(size=SAMPLES)
    assert cycle_period(column_run(quiet, np.full(SAMPLES, 50.0), {})) is None


def test_means_leave_out_what_is_not_there() -> None:
    one = SCORES["unaware"]
    lost = dataclasses.replace(one.outputs["C"], iae=one.outputs["C"].iae + 2.0, amplitude=math.nan)
    other = dataclasses.replace(one, outputs={**one.outputs, "C": lost}, median_ms=2.5)
    mean = mean_score([one, other])
    assert mean.outputs["C"].iae == pytest.approx(one.outputs["C"].iae + 1.0)
    assert mean.outputs["C"].amplitude == one.outputs["C"].amplitude
    assert mean.median_ms == pytest.approx(2.0)
    assert math.isnan(mean.from_warm_start)


def test_every_controller_has_a_row_for_each_output() -> None:
    rows = rows_of(PlantStudy.of([made_up_trial()]), short=True)
    assert [row[0] for row in rows[::2]] == [column.short for column in COLUMNS]
    assert [row[1] for row in rows] == ["C", "T"] * len(COLUMNS)
    moves = [row[8] for row in rows[::2]]
    assert (moves[0], moves[-1]) == ("31", "–")  # a healthy valve's moves say nothing


@pytest.mark.trial
def test_the_page_stands_alone_with_its_figures(tmp_path: Path) -> None:
    study = PlantStudy.of([made_up_trial(seed) for seed in (1, 2)])
    page = report_study([study], tmp_path).read_text(encoding="utf-8")
    assert page.count("<figure") == 2 + len(COLUMNS)  # each output, V1 under each controller
    assert 'src="http' not in page
    assert "25.0 %" in page


def test_what_was_run_is_told_in_a_line() -> None:
    told = describe(PlantStudy.of([made_up_trial(seed) for seed in (1, 2)]))
    assert "seeds 1 to 2; held-out set-points, a move every 120 min" in told
