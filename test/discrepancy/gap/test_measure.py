"""The share of a gap that an effect closes."""

import pytest

from stiction_ros.discrepancy.gap.measure import OutputGap, Shrunk, closed_share, gone_share


def gap(free_run: float, floor: float) -> tuple[OutputGap, ...]:
    return (OutputGap("PV1", free_run, 1.0, floor, 1.0),)


def test_what_is_left_above_the_floor_is_not_closed() -> None:
    assert closed_share(gap(3.0, 1.0), gap(2.0, 1.0)) == pytest.approx(0.5)


def test_held_out_rows_with_less_noise_by_chance_have_a_lower_floor() -> None:
    assert closed_share(gap(0.95, 1.0), gap(0.9, 1.0)) == pytest.approx(1.0)


def test_what_moves_away_closes_nothing() -> None:
    assert closed_share(gap(0.9, 1.0), gap(0.95, 1.0)) == 0.0


def test_outputs_count_by_their_excess_in_units_of_their_innovations() -> None:
    ends = [Shrunk(3.0, 2.0, 1.0, 1.0), Shrunk(30.0, 10.0, 10.0, 10.0)]
    assert gone_share(ends) == pytest.approx(0.75)
