"""The experiment that an ambiguous answer names leaves the truth alone."""

import pytest
from experiments import ask, decided

from stiction_studies.field.hidden import hidden_loop


@pytest.mark.trial
@pytest.mark.parametrize(
    ("seed", "named"),
    [
        (79804, "flow behind the valve"),  # a sine of the load
        (79808, "second sensor"),  # a step of the output
        (79814, "second sensor"),  # a step of the sensor
        (79825, "record the stem position"),  # a step of the load
        (79828, "ramp OP"),  # Karnopp's friction
    ],
)
def test_the_experiment_leaves_the_truth_alone(seed: int, named: str) -> None:
    loop = hidden_loop(seed)
    answer = ask(loop, loop.record)
    assert named in answer.experiment
    assert decided(loop, answer)
