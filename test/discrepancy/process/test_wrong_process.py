"""A process that is another than the model is named by its own figures."""

import dataclasses

import numpy as np
import pytest
from scipy.signal import cont2discrete

from stiction_ros.discrepancy import Discrepancy, GapOptions, GapVerdict, find_discrepancy
from stiction_ros.loop import LoopModel, SetPoints, simulate

LEVELS = (53.0, 47.0, 51.0, 55.0, 48.0, 50.0)


def loop(*lags: float, delay: int = 5) -> LoopModel:
    under = np.ones(1)
    for each in lags or (12.0,):
        under = np.polymul(under, [each, 1.0])
    b, a, _ = cont2discrete(([1.2], under), 1.0)
    output = {
        "name": "PV1",
        "a": a[1:].tolist(),
        "b": {"V1": b[0][1:].tolist()},
        "delay": {"V1": delay},
        "bias": 0.0,
        "noise": {"std": 0.1, "enters": "measurement"},
    }
    document = {
        "loop": "process",
        "sample_time": 1.0,
        "valves": [{"name": "V1", "effects": []}],
        "process": {"kind": "arx", "outputs": [output]},
        "sensors": [{"name": "PV1", "effects": []}],
        "disturbances": [],
        "operating_point": {"op": {"V1": 50.0}, "pv": {"PV1": 50.0}},
        "controller": {"kind": "pi", "gain": 0.5, "integral_time": 12.0},
        "provenance": [],
    }
    return LoopModel.from_mapping(document)


def answered(model: LoopModel) -> Discrepancy:
    moves = [{"time": 150.0 * k, "PV1": level} for k, level in enumerate(LEVELS)]
    schedule = SetPoints.from_mapping({"repeat": 900.0, "moves": moves}, ("PV1",), "test")
    record = dataclasses.replace(simulate(loop(), schedule, samples=900, seed=3), stem=None)
    return find_discrepancy(model, [record], GapOptions(quick=True))


@pytest.mark.parametrize(
    ("model", "what", "value", "said"),
    [
        (loop(6.0), "time_constant", 2.0, "in the model 6 s"),
        (loop(12.0, 5.0), "time_constant", 0.0, "no time constant of 5 s"),
        (loop(delay=8), "delay", -3.0, "s shorter than in the model"),
        (loop(delay=6), "delay", -1.0, "s shorter than in the model"),
    ],
)
def test_a_figure_that_is_no_effect_is_named(
    model: LoopModel, what: str, value: float, said: str
) -> None:
    found = answered(model)
    assert (found.verdict, found.effects) == (GapVerdict.NAMED, ())
    (change,) = found.process_changes
    assert change.what == what
    assert change.value == pytest.approx(value, abs=0.15)
    assert change.interval[0] <= value < change.interval[1]
    assert said in change.sentence
    assert found.after[0].one_step_rmse < found.before[0].one_step_rmse


def test_what_is_too_small_to_matter_is_corrected_and_no_finding() -> None:
    found = answered(loop(12.55))
    assert (found.verdict, found.effects, found.process_changes) == (GapVerdict.NONE, (), ())
    assert any(
        "in the model 12.5 s" in said and "too small to matter" in said for said in found.where
    )
    assert found.model_after != found.model_before
