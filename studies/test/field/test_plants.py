"""Plants of the field: at rest, stepped, tuned."""

import dataclasses

import numpy as np
import pytest

from stiction_studies.field.plants import KINDS, Plant, draw_process
from stiction_studies.field.simulation import FRICTIONLESS, Clock, Controller, Loop, Signals, run
from stiction_studies.field.tuning import (
    Wish,
    calm,
    closed_loop_time,
    late,
    step_test,
    swing_left,
    tuned,
    ultimate_factor,
)


@pytest.mark.parametrize("plant", list(Plant))
@pytest.mark.parametrize("seed", [0, 1])
def test_a_plant_answers_its_valve_and_its_load(plant: Plant, seed: int) -> None:
    process = draw_process(np.random.default_rng(seed), plant)
    answer = step_test(process)
    assert np.isfinite(answer.state).all()
    assert answer.gain != 0.0
    assert answer.lag > 0.0
    assert abs(answer.load) > 1.0
    assert np.isinf(answer.lag) == process.integrating
    assert process.kind == KINDS[plant]


@pytest.mark.parametrize("plant", list(Plant))
def test_a_tuned_loop_comes_to_rest_and_swings_at_the_ultimate_gain(plant: Plant) -> None:
    process = draw_process(np.random.default_rng(3), plant)
    answer = step_test(process)
    scan = max(process.fastest, process.slowest / 200.0)
    if process.integrating:
        scan = process.fastest
    step = scan / np.ceil(scan / process.fastest)
    delay = late(answer, process, scan)
    wish = Wish(3.0, 0.3)
    controller = tuned(answer, delay, wish)
    loop = Loop(process, FRICTIONLESS, controller, Clock(step, round(scan / step), 1), answer.state)
    time = closed_loop_time(answer, delay, wish) + delay
    loop = calm(loop, answer, time)
    assert swing_left(loop, answer, time, 1.0) <= 0.02
    factor = ultimate_factor(loop, answer, time)
    assert factor > 1.0
    assert swing_left(loop, answer, time, 0.8 * factor) < 1.0


def test_the_four_tanks_rest_where_they_were_published() -> None:
    process = draw_process(np.random.default_rng(0), Plant.FOUR_TANKS)
    state = step_test(process).state
    assert state[:4] == pytest.approx([12.3, 12.8, 1.63, 1.41], rel=0.05)


def test_the_column_has_the_published_gain() -> None:
    for seed in range(6):
        process = draw_process(np.random.default_rng(seed), Plant.COLUMN)
        assert step_test(process).gain / 0.04 == pytest.approx(
            12.8 if process.dead_time == 60.0 else -19.4, rel=0.03
        )


def flow_loop(controller: Controller) -> Loop:
    process = draw_process(np.random.default_rng(5), Plant.FLOW)
    answer = step_test(process)
    gain = 0.4 / answer.gain
    controller = dataclasses.replace(controller, gain=gain, integral=answer.lag)
    step = 0.5 * process.fastest
    return Loop(process, FRICTIONLESS, controller, Clock(step, 2, 2), answer.state)


@pytest.mark.parametrize("velocity", [True, False])
def test_a_controller_at_its_limit_does_not_wind_up(velocity: bool) -> None:
    loop = flow_loop(Controller(1.0, 1.0, velocity=velocity, high=80.0))
    count = 6000
    signals = Signals.quiet(count, loop.rest)
    target = signals.set_point.copy()
    target[200:3000] *= 10.0
    op = run(loop, dataclasses.replace(signals, set_point=target)).op
    assert op[2999] == 80.0
    assert op.max() == 80.0
    assert op[3100] < 78.0  # it leaves the limit at once
    assert op[-1] == pytest.approx(loop.process.stem, abs=0.5)


@pytest.mark.parametrize("velocity", [True, False])
def test_manual_begins_and_ends_without_a_bump(velocity: bool) -> None:
    loop = flow_loop(Controller(1.0, 1.0, velocity=velocity))
    signals = Signals.quiet(900, loop.rest)
    manual, by_hand = signals.manual.copy(), signals.by_hand.copy()
    manual[300:600], by_hand[400:600] = True, 4.0
    op = run(loop, dataclasses.replace(signals, manual=manual, by_hand=by_hand)).op
    assert op[300:400] == pytest.approx(op[299])
    assert op[401:600] == pytest.approx(op[299] + 4.0)
    assert abs(op[600] - op[599]) < 2.0


def test_dead_time_shifts_the_answer() -> None:
    process = draw_process(np.random.default_rng(3), Plant.EXCHANGER)
    state, step = step_test(process).state, process.fastest / 8.0
    later = dataclasses.replace(process, dead_time=process.dead_time + 40.0 * step)
    answers = []
    for each in (process, later):
        loop = Loop(each, FRICTIONLESS, Controller(1.0, 1.0), Clock(step, 1, 1), state)
        answers.append(run(loop, Signals.quiet(2000, 0.0, 5.0)).clean - loop.rest)
    assert np.ptp(answers[0]) > 0.1
    assert answers[1][40:] == pytest.approx(answers[0][:-40], abs=1e-3 * np.ptp(answers[0]))
