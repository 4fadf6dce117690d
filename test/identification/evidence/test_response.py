"""A PV that does not answer its valve is told as such."""

import dataclasses

import numpy as np
import pytest
from evidence_loops import pi_loop

from stiction_ros.identification import Identification, identify
from stiction_ros.records.record import Record


def stuck(seed: int) -> Identification:
    """Return what is identified of a loop whose OP wanders while PV is noise of its own."""
    random = np.random.default_rng(seed)
    op = 50.0 + np.cumsum(random.standard_normal(900))
    pv = np.convolve(random.standard_normal(900), 0.8 ** np.arange(30), "same")
    return identify(Record("stuck", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None]))


def test_a_stem_that_never_moves_is_named() -> None:
    valve = stuck(3).valves[0]
    assert not valve.responds
    assert not valve.verdict.has_friction
    assert valve.to_dict()["responds"] is False
    assert valve.experiment.startswith("PV does not answer OP of V1: the stem is stuck")


@pytest.mark.trial
def test_a_pv_that_answers_is_told_so() -> None:
    for record in (pi_loop(0.0, 0.0, samples=900), pi_loop(3.0, 1.0, samples=900)):
        assert identify(dataclasses.replace(record, name="loop")).valves[0].responds
