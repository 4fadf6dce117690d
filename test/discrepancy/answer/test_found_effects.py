"""What is no name: figures that hold nothing out."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from stiction_ros.discrepancy.answer.found_effects import holds_nothing_out
from stiction_ros.effects import ProcessGain


@pytest.mark.parametrize(
    ("interval", "nothing"), [((0.7, 0.9), False), ((0.7, 1.1), True), ((1.1, 1.4), False)]
)
def test_a_gain_that_may_be_that_of_the_model_is_no_name(
    interval: tuple[float, float], nothing: bool
) -> None:
    pv = np.linspace(0.0, 1.0, 50)[:, None]
    runs = SimpleNamespace(pv=pv, op=pv, time=np.arange(50.0))
    model = SimpleNamespace(outputs=("PV1",), valve_names=("V1",))
    base = cast("Any", SimpleNamespace(run=SimpleNamespace(runs=runs, model=model)))
    fit = SimpleNamespace(candidate=SimpleNamespace(factors=1, axes=()))
    effect = SimpleNamespace(place="process:PV1", fit=fit, behaviour=ProcessGain(0.8))
    assert holds_nothing_out(cast("Any", effect), base, {"factor": interval}) is nothing
