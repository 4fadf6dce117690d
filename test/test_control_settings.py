import dataclasses
from typing import Any

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.control_settings import ControlSettings
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel

TANK = LoopModel.load(find_config("tank_linear.loop.yaml"))


def test_weights_are_those_of_19a_on_the_outputs() -> None:
    settings = ControlSettings(
        output_weights=(100.0, 1.0), state_weight=0.01, terminal_weight=5.0, move_weights=(0.1, 0.2)
    )
    design = settings.design(TANK)
    c = TANK.process.linear(60.0).c
    q = c.T @ np.diag([100.0, 1.0]) @ c
    assert design.unaware.state == pytest.approx(q + 0.01 * np.eye(5))
    assert design.unaware.terminal == pytest.approx(q + 5.0 * np.eye(5))
    assert design.unaware.move.tolist() == [[0.1, 0.0], [0.0, 0.2]]


def test_a_single_entry_stands_for_all() -> None:
    design = ControlSettings(embedding_move_weights=(0.3,), op_rate_limits=(7.0,)).design(TANK)
    assert design.embedding.move.tolist() == [[0.3, 0.0], [0.0, 0.3]]
    assert design.limits.move.tolist() == [7.0, 7.0]


def test_limits_come_from_the_valves() -> None:
    assert ControlSettings().design(TANK).limits.stem.tolist() == [[0.0, 100.0], [0.0, 100.0]]


LISTS = (
    "output_weights",
    "move_weights",
    "embedding_move_weights",
    "move_worth",
    "kick_limits",
    "target_weights",
    "op_rate_limits",
    "pv_low",
    "pv_high",
    "disturbance_noise",
    "measurement_noise",
)


@pytest.mark.parametrize("name", LISTS)
@pytest.mark.parametrize("values", [(), (1.0, 1.0, 1.0)])
def test_a_list_of_the_wrong_length_is_refused_by_name(name: str, values: Any) -> None:
    with pytest.raises(InputError) as caught:
        ControlSettings(**{name: values}).design(TANK)
    assert (caught.value.where, bool(caught.value.fix)) == (name, True)


def test_crossed_output_bounds_are_refused() -> None:
    with pytest.raises(InputError, match="pv_low"):
        ControlSettings(pv_low=(5.0,), pv_high=(5.0,)).design(TANK)


def test_a_horizon_within_the_dead_time_is_refused() -> None:
    example1 = LoopModel.load(find_config("example1_process.loop.yaml"))  # delay of 5 samples
    with pytest.raises(InputError, match="V1 moves no output within 5 samples"):
        ControlSettings(horizon=5).design(example1)
    ControlSettings(horizon=6).design(example1)


def test_bounds_of_op_narrow_those_of_the_valves() -> None:
    design = ControlSettings(op_low=(20.0, -5.0), op_high=(70.0,)).design(TANK)
    assert design.limits.stem.tolist() == [[20.0, 70.0], [0.0, 70.0]]


def test_bounds_of_op_that_leave_nothing_are_refused() -> None:
    with pytest.raises(InputError) as caught:
        ControlSettings(op_low=(60.0,), op_high=(50.0,)).design(TANK)
    assert caught.value.where == "op_low"


def test_two_moves_cost_as_much_as_the_offset_whose_iae_they_are_worth() -> None:
    settings = ControlSettings(horizon=30, look_ahead=70, output_weights=(4.0, 1.0))
    design = dataclasses.replace(settings, move_worth=(0.05, 0.0)).design(TANK)
    samples, worth = 100, 0.05 * 3600.0 / TANK.sample_time
    offset = 2.0 * worth / samples  # its IAE is what two moves are worth
    prices = design.jumps.move_prices
    assert prices is not None
    assert 2.0 * prices[0] == pytest.approx(4.0 * offset**2 * samples)
    assert prices[1] == 0.0
    assert design.embedding.look_ahead == 70
    assert design.unaware.look_ahead == 0


def first_order(gain: float, noise: float) -> LoopModel:
    output = {"name": "PV1", "a": [-0.9], "b": {"V1": [0.1 * gain]}, "noise": {"std": noise}}
    return LoopModel.from_mapping(
        {
            "loop": "own",
            "sample_time": 1.0,
            "valves": [{"name": "V1"}],
            "process": {"kind": "arx", "outputs": [output]},
        },
        "own",
    )


def test_by_default_a_loop_in_other_units_has_the_same_controller() -> None:
    one, other = (ControlSettings().design(first_order(g, 0.05 * abs(g))) for g in (1.0, -20.0))
    assert other.unaware.move == pytest.approx(400.0 * one.unaware.move)
    assert other.embedding.move == pytest.approx(400.0 * one.embedding.move)
    assert other.jumps.jump_price == pytest.approx(400.0 * one.jumps.jump_price)
    assert other.observer.measurement_noise == pytest.approx(400.0 * one.observer.measurement_noise)
    assert other.observer.disturbance_noise == pytest.approx(400.0 * one.observer.disturbance_noise)


def test_by_default_a_jump_costs_more_where_the_estimate_is_less_sure() -> None:
    quiet, loud = (ControlSettings().design(first_order(1.0, std)) for std in (0.05, 0.5))
    assert loud.jumps.jump_price > quiet.jumps.jump_price > 0.0
    given = ControlSettings(embedding_move_weights=(0.01,)).design(first_order(1.0, 0.5))
    assert given.jumps.jump_price == 0.0
