"""Needles that all grids step over are found on growing beginnings of a record."""

import dataclasses

import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.effects import FloatArray
from stiction_ros.identification import IdentificationOptions
from stiction_ros.identification.exact.search import growing_patterns, search
from stiction_ros.identification.friction import Judge
from stiction_ros.identification.growing import first_beginning, grown
from stiction_ros.identification.problem.models import linear_model
from stiction_ros.identification.problem.preparation import prepare, window
from stiction_studies.examples import example2


def test_a_valley_that_narrows_is_followed_to_its_end() -> None:
    needle, met = np.array([0.5012, 0.1987, 0.1003]), list[int]()

    def judged(rows: int) -> Judge:
        met.append(rows)
        return lambda tried: ((tried - needle) ** 2).sum(axis=1).clip(1e3 * rows**-3.0)

    rows, losses = grown(judged, 600, 100, 1.0)
    assert met[0] == 100
    assert sorted(met) == met
    assert met[-1] == 600
    assert rows[losses.argmin()] == pytest.approx(needle, abs=1e-2)
    assert (rows[:, 1] <= rows[:, 0]).all()


def test_the_first_beginning_holds_the_first_turns() -> None:
    op = np.sin(2.0 * np.pi * np.arange(2000) / 100.0)
    assert 280 <= first_beginning(op, 2.0) <= 400
    assert first_beginning(op, 2.0, rate=2) in range(140, 201)
    assert first_beginning(np.zeros(3000), 1.0) == 1000
    assert first_beginning(op[:150], 2.0, least=120) == 120


def test_a_record_whose_op_rests_at_first_keeps_its_model() -> None:
    record = loops.example1(1, "equation", samples=600)
    data = prepare(record, IdentificationOptions(output_order=3, input_order=3, delay=(4, 6)))
    model = linear_model(data, window(IdentificationOptions(delay=(4, 6)), 3, 3))
    still = dataclasses.replace(data, u=np.where(np.arange(600) < 590, 0.0, data.u))
    assert growing_patterns(still, model, 0) is model


@pytest.mark.trial
@pytest.mark.parametrize(("plant", "seed"), [("tank", 54), ("tank", 135), ("linear", 68)])
def test_a_needle_that_the_grids_step_over_is_found(plant: str, seed: int) -> None:
    example = example2(seed, plant, samples=620)
    data = prepare(example.record, example.options)
    linear = linear_model(data, window(example.options, 2, 2))

    def missed(friction: FloatArray) -> float:
        return float(np.abs(friction[0] - [8.0, 1.0]).max())

    assert missed(search(data, linear, growing=False)[0].friction) > 0.15
    assert missed(search(data, linear)[0].friction) < 0.15
