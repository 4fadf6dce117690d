"""The friction of least one-step SE, on the scale of the paper's methods."""

import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.identification import Identification, IdentificationOptions, identify
from stiction_ros.identification.problem.equation_error import ArxOrders, squared_error
from stiction_ros.records.record import Record

OPTIONS = IdentificationOptions("exact", output_order=3, input_order=3)


@pytest.fixture(scope="module", params=["measurement", "equation"])
def case(request: pytest.FixtureRequest) -> tuple[Record, Identification]:
    record = loops.example1(2, request.param)
    return record, identify(record, OPTIONS)


def error_of(case: tuple[Record, Identification], friction: list[float], delay: int) -> float:
    record, found = case
    assert found.search is not None
    orders = ArxOrders(3, 3, found.search.first)
    return squared_error(record, np.array([friction]), ((delay,),), orders)


def test_what_it_reports_is_its_own_error(case: tuple[Record, Identification]) -> None:
    log = case[1].search
    assert log is not None
    again = error_of(case, list(log.friction[0]), log.delays[0][0])
    assert log.squared_error == pytest.approx(again, rel=1e-12)


def test_neither_truth_nor_answer_nor_random_frictions_beat_it(
    case: tuple[Record, Identification],
) -> None:
    log, valve = case[1].search, case[1].valves[0]
    assert log is not None
    rivals = [[5.0, 2.0], [valve.static_friction, valve.dynamic_friction], [0.0, 0.0]]
    generator = np.random.default_rng(0)
    rivals += (np.array([5.0, 2.0]) + 0.1 * generator.standard_normal((60, 2))).tolist()
    for friction in rivals:
        for delay in (4, 5, 6):
            assert log.squared_error <= error_of(case, friction, delay) * (1.0 + 1e-9)


def test_longer_delay_by_one_step_is_told_in_a_note() -> None:
    found = identify(loops.example1(2, "measurement"), OPTIONS)
    assert found.search is not None
    assert found.outputs[0].delay == {"V1": 5}
    assert found.search.delays == ((6,),)
    assert any("6 by least one-step SE" in note for note in found.notes)


def test_it_is_left_out_when_not_wanted() -> None:
    options = IdentificationOptions("exact", output_order=3, input_order=3, one_step_best=False)
    assert identify(loops.example1(0, samples=600), options).search is None
