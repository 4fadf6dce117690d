"""Loops without friction: ideal valves, real oscillations."""

import numpy as np
import pytest

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import PiController, SetPoints, simulate_closed_loop
from stiction_studies.examples import FAMILIES, Example, healthy_loop

SEEDS = range(1, 8)


@pytest.fixture(
    scope="module",
    params=[FAMILIES[0], *(pytest.param(f, marks=pytest.mark.trial) for f in FAMILIES[1:])],
)
def loops(request: pytest.FixtureRequest) -> list[Example]:
    return [healthy_loop(seed, request.param) for seed in SEEDS]


def crossings(values: FloatArray) -> int:
    return int(np.count_nonzero(np.diff(np.sign(values - values.mean()))))


def test_valves_are_ideal(loops: list[Example]) -> None:
    for loop in loops:
        assert loop.record.stem is not None
        assert np.array_equal(loop.record.stem, loop.record.op)
        assert loop.friction("V1") == (0.0, 0.0)


def test_op_oscillates_widely(loops: list[Example]) -> None:
    for loop in loops:
        assert 2.0 <= loop.record.op.std() <= 10.0
        assert crossings(loop.record.op[:, 0]) >= 10


def test_lengths_and_set_points_vary(loops: list[Example]) -> None:
    lengths = [len(loop.record) for loop in loops]
    assert all(1000 <= length <= 2500 for length in lengths)
    moving = [loop.record.sp is not None and np.ptp(loop.record.sp) > 0 for loop in loops]
    assert 0 < sum(moving) < len(loops)
    assert len({loop.record.sample_time for loop in loops}) > 2
    assert len({loop.delay("PV1", "V1") for loop in loops}) > 3


def test_same_seed_same_record(loops: list[Example]) -> None:
    again = healthy_loop(loops[4].seed, loops[4].variant)
    assert np.array_equal(again.record.op, loops[4].record.op)
    assert np.array_equal(again.record.pv, loops[4].record.pv)


def test_op_is_what_the_recorded_controller_makes_of_pv(loops: list[Example]) -> None:
    for loop in loops:
        tuning, record = loop.truth.controller, loop.record
        assert tuning is not None
        assert record.sp is not None
        error = (record.sp - record.pv)[:, 0]
        step = np.diff(error) + record.sample_time / tuning.integral_time * error[1:]
        assert np.allclose(np.diff(record.op[:, 0]), tuning.gain * step, atol=1e-9)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_tight_loops_ring_for_long_but_are_stable(seed: int) -> None:
    loop = healthy_loop(seed, "tight").truth
    assert loop.controller is not None
    document = loop.to_mapping()
    document["process"]["outputs"][0]["noise"] = {"std": 0.0}
    quiet = type(loop).from_mapping(document)
    controller = PiController(loop.controller, loop.sample_time, 50.0, (-1e9, 1e9))
    step = SetPoints(("PV1",), np.array([0.0, loop.sample_time]), np.array([[50.0], [51.0]]))
    run = simulate_closed_loop(quiet, controller, step, 3000, 1)
    error = np.abs(run.record.pv[:, 0] - 51.0)
    assert error[100:200].max() > 0.1
    assert error[2900:].max() < 0.05


@pytest.mark.parametrize("seed", [3, 6, 7])
def test_a_sine_without_set_points_is_a_line_in_op(seed: int) -> None:
    record = healthy_loop(seed, "sine").record
    assert record.sp is not None
    assert np.ptp(record.sp) == 0.0
    op = (record.op - record.op.mean())[:, 0] * np.hanning(len(record))
    power = np.abs(np.fft.rfft(op)) ** 2
    top = int(np.argmax(power))
    assert power[max(top - 3, 0) : top + 4].sum() > 0.5 * power.sum()


def test_unknown_family_is_refused() -> None:
    with pytest.raises(InputError, match="tight or sine or coloured"):
        healthy_loop(1, "loose")
