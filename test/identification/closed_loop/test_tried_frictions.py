"""With which frictions a loop is run again."""

import dataclasses

import numpy as np
import pytest

from stiction_ros.identification import VerdictKind
from stiction_ros.identification.closed_loop.repeated_runs import tried_frictions
from stiction_ros.identification.evidence.further import widened
from stiction_ros.identification.result import ValveEstimate

VALVE = ValveEstimate(
    "V1", VerdictKind.STICKY, "he", 3.0, (2.0, 4.5), 1.0, (0.2, 2.0), 2.0, 0.0, 40, {}
)


def test_both_ends_are_those_of_the_intervals_where_the_sum_has_none_of_its_own() -> None:
    assert VALVE.sum_interval == pytest.approx((2.2, 6.5))
    assert tried_frictions(VALVE).tolist() == [[3.0, 1.0], [2.0, 0.2], [4.5, 2.0]]


def test_a_band_of_its_own_is_kept_at_both_ends() -> None:
    told = dataclasses.replace(VALVE, band_interval=(3.0, 5.0))
    assert told.sum_interval == (3.0, 5.0)
    assert told.to_dict()["band_interval"] == [3.0, 5.0]
    tried = tried_frictions(told)
    assert tried.tolist() == [[3.0, 1.0], [2.0, 1.0], [4.5, 0.5]]


def test_further_parameters_widen_a_band_of_its_own_too() -> None:
    rows = np.array([[3.0, 1.0, 0.5, 0.0], [4.8, 1.5, 0.9, 0.0]])
    told = dataclasses.replace(VALVE, band_interval=(3.0, 5.0))
    found = widened(told, {"K": 0.7}, rows)
    assert found.band_interval == pytest.approx((3.0, 6.3))
    assert widened(VALVE, {"K": 0.7}, rows).band_interval is None
