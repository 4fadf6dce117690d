"""The share of a gap that an effect closes."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from stiction_ros.discrepancy.gap.measure import OutputGap, closed_share, gap_in_one_step
from stiction_ros.discrepancy.likelihood.noise import Blocks


def gap(free_run: float, floor: float) -> tuple[OutputGap, ...]:
    return (OutputGap("PV1", free_run, 1.0, floor, 1.0),)


def test_what_is_left_above_the_floor_is_not_closed() -> None:
    assert closed_share(gap(3.0, 1.0), gap(2.0, 1.0)) == pytest.approx(0.5)


def test_held_out_rows_with_less_noise_by_chance_have_a_lower_floor() -> None:
    assert closed_share(gap(0.95, 1.0), gap(0.9, 1.0)) == pytest.approx(1.0)


def test_what_moves_away_closes_nothing() -> None:
    assert closed_share(gap(0.9, 1.0), gap(0.95, 1.0)) == 0.0


def leaving(std: float) -> Any:
    """Return a baseline of two outputs whose innovations have this size on half of the rows."""
    held = np.arange(200) % 2 == 0
    values = std * np.where(np.arange(200) % 4 < 2, 1.0, -1.0)
    noise = SimpleNamespace(innovations=np.where(held, values, 10.0))
    model = SimpleNamespace(outputs=("PV1", "PV2"))
    blocks = Blocks(~held, held)
    run = SimpleNamespace(model=model)
    return cast("Any", SimpleNamespace(run=run, noise=(noise,) * 2, blocks=(blocks,) * 2))


def test_in_one_step_the_declared_noise_is_the_floor() -> None:
    before, after = (gap_in_one_step(leaving(std), [1.0, float("nan")]) for std in (3.0, 2.0))
    assert [each.name for each in before] == ["PV1"]
    assert closed_share(before, after) == pytest.approx(0.5)


def test_in_one_step_fitted_rows_count_where_they_are_asked_for() -> None:
    (gap,) = gap_in_one_step(leaving(3.0), [1.0, float("nan")], every=True)
    assert gap.one_step_rmse == pytest.approx(np.sqrt((9.0 + 100.0) / 2.0))
