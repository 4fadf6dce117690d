"""Near the truth the polygons are closed, and no point of their region beats the best."""

import dataclasses

import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.effects import SemiPhysicalStiction
from stiction_ros.identification import IdentificationOptions
from stiction_ros.identification.exact.growing_swarm import growing_swarm, swarm_round
from stiction_ros.identification.exact.pattern_search import nearby_delays
from stiction_ros.identification.exact.polygon_search import polygon_neighbourhood, refine_near
from stiction_ros.identification.problem.models import (
    Data,
    Model,
    linear_model,
    scan_valve,
    with_valve,
)
from stiction_ros.identification.problem.output_error import Orders
from stiction_ros.identification.problem.preparation import prepare, window

OPTIONS = IdentificationOptions(output_order=3, input_order=3, law="semi_physical")
TRUTH = np.array([5.0, 2.0])


@pytest.fixture(scope="module")
def at_truth() -> tuple[Data, Model, Orders]:
    record = loops.example1(1, samples=900, valve=SemiPhysicalStiction(*TRUTH))
    data, orders = prepare(record, OPTIONS), window(OPTIONS, 3, 3)
    start = float(-record.op[0, 0])  # the stem rests at 0
    linear = linear_model(data, orders)
    return data, with_valve(data, linear, orders, 0, TRUTH, start, np.array([5])), orders


def test_enumeration_closes_round_the_truth(at_truth: tuple[Data, Model, Orders]) -> None:
    found = polygon_neighbourhood(*at_truth, 0, 8.0)
    assert found.closed
    assert found.patterns > 1
    assert found.best == pytest.approx(TRUTH, abs=0.05)


def test_no_point_nearby_beats_the_polygons(at_truth: tuple[Data, Model, Orders]) -> None:
    data, model, orders = at_truth
    found = polygon_neighbourhood(data, model, orders, 0, 8.0)
    generator = np.random.default_rng(3)
    scale = 10.0 ** generator.uniform(-6.0, -2.0, (2000, 1))
    rows = TRUTH + scale * generator.standard_normal((2000, 2))
    ranges = nearby_delays(data, model, 0, 0)
    scan = scan_valve(data, model, orders, 0, rows, model.start[0], ranges=ranges)
    assert found.scan.loss.min() <= scan.loss.min() + 1e-2  # of f_D inside a polygon


def test_a_start_a_little_off_is_corrected(at_truth: tuple[Data, Model, Orders]) -> None:
    data, model, orders = at_truth
    off = with_valve(data, model, orders, 0, TRUTH, float(model.start[0]) + 5e-4, np.array([5]))
    better, found = refine_near(data, off, orders, 0, 8.0)
    assert found is not None
    assert better.loss <= off.loss
    assert abs(better.start[0] - model.start[0]) < 0.02


def test_valve_without_friction_has_no_polygons(at_truth: tuple[Data, Model, Orders]) -> None:
    data, _, orders = at_truth
    linear = linear_model(data, orders)
    assert refine_near(data, linear, orders, 0, 8.0) == (linear, None)


@pytest.mark.trial
def test_growing_windows_end_at_the_truth(at_truth: tuple[Data, Model, Orders]) -> None:
    data, model, orders = at_truth
    found = growing_swarm(data, linear_model(data, orders), orders, 0)
    assert found is not None
    assert found.friction[0] == pytest.approx(TRUTH, abs=0.05)
    assert found.loss < model.loss + 20.0


def test_a_record_shorter_than_the_first_window_is_given_up(
    at_truth: tuple[Data, Model, Orders],
) -> None:
    data, _, orders = at_truth
    short = dataclasses.replace(data, y=data.y[:, :60], u=data.u[:, :60])
    assert growing_swarm(short, linear_model(short, orders), orders, 0) is None


def test_swarm_stays_in_the_triangle(at_truth: tuple[Data, Model, Orders]) -> None:
    _, model, _ = at_truth
    rows = swarm_round(model, 0, 6.0)
    assert rows.shape[1] == 3
    assert (rows[:, 0] <= 6.0).all()
    assert ((rows[:, 1] >= 0.0) & (rows[:, 1] <= rows[:, 0])).all()
    assert (np.abs(rows[:, 2]) <= rows[:, 0]).all()
    assert (swarm_round(model, 0, 6.0) == rows).all()
