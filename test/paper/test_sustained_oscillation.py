"""Δu is the span of the cycle, not that of the throws at set-point moves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.grid_search import count_points
from stiction_ros.paper.paper_options import PaperOptions
from stiction_ros.paper.sustained_oscillation import sustained_oscillations
from stiction_ros.records import Record
from stiction_studies.examples import example1, example2_of_one_round


def made(op: FloatArray, sp: FloatArray | None) -> Record:
    pv = np.sin(np.arange(len(op)) / 7.0)
    return Record("made", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None], sp)


@given(
    cycle=st.floats(0.5, 10.0),
    throw=st.floats(2.0, 10.0),
    period=st.integers(8, 40),
    drift=st.floats(-3.0, 3.0),
)
def test_throws_at_set_point_moves_do_not_count(
    cycle: float, throw: float, period: int, drift: float
) -> None:
    time = np.arange(800)
    op = 0.5 * cycle * np.sign(np.sin(2.0 * np.pi * (time + 0.5) / period))
    op = op + drift * (time // 200) + throw * cycle * (time % 200 < 15)
    sp = (time // 200).astype(float)[:, None]
    (found,) = sustained_oscillations(made(op, sp))
    assert found.sustained
    assert found.span == pytest.approx(cycle)
    assert found.alike == 4
    assert found.whole >= throw * cycle


def test_a_cycle_that_is_seen_in_one_hold_only_is_not_sustained() -> None:
    op = np.zeros(800)
    op[300:400] = 5.0 * np.sin(np.arange(100) / 4.0)
    op[0] = 20.0
    sp = (np.arange(800) // 200).astype(float)[:, None]
    (found,) = sustained_oscillations(made(op, sp))
    assert not found.sustained
    assert found.span == found.whole == pytest.approx(np.ptp(op))


def test_without_a_set_point_the_record_is_cut_into_parts() -> None:
    op = 2.0 * np.sin(2.0 * np.pi * np.arange(800) / 25.0)
    op[10] = 30.0
    (found,) = sustained_oscillations(made(op, None))
    assert len(found.parts) == 8
    assert found.span == pytest.approx(4.0, rel=0.02)


@pytest.mark.trial
def test_the_paper_s_grids_have_the_paper_s_points() -> None:
    """Seed 1: Δu is 8.7 % in Example 1, 10.9 and 2.4 % in Example 2."""
    record = example1(1).record
    (found,) = sustained_oscillations(record)
    assert found.span == pytest.approx(8.7, abs=0.05)
    assert count_points(record, PaperOptions(method="grid", grid_step=0.1)) == 3916
    record = example2_of_one_round(1).record
    spans = [one.span for one in sustained_oscillations(record)]
    assert spans == pytest.approx([10.9, 2.4], abs=0.05)
    assert count_points(record, PaperOptions(method="grid", grid_step=1.0)) == 396
