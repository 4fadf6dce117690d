"""Loops with something hidden in them: what a seed gives."""

import dataclasses

import numpy as np
import pytest

from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_studies.field.hidden import FAMILIES, HiddenLoop, hidden_loop
from stiction_studies.field.hidden.effect import LOAD, VALVE, Effect
from stiction_studies.field.hidden.hiding import KINDS
from stiction_studies.field.hidden.simulation import LEAD, Signals, run

SEEDS = range(900, 960)


@pytest.fixture(scope="module")
def loops() -> list[HiddenLoop]:
    return [hidden_loop(seed) for seed in SEEDS]


def test_a_seed_gives_the_same_loop_again(loops: list[HiddenLoop]) -> None:
    again = hidden_loop(SEEDS[0])
    assert again.hidden == loops[0].hidden
    assert again.given == loops[0].given
    assert np.array_equal(again.record.pv, loops[0].record.pv)


def test_loops_are_of_many_kinds_and_in_control(loops: list[HiddenLoop]) -> None:
    assert len({loop.cause for loop in loops}) > 15
    assert len({loop.surroundings.plant for loop in loops}) >= 7
    assert 4 <= sum(not loop.hidden for loop in loops) <= 24
    for loop in loops:
        assert 1200 <= len(loop.record) <= 2000
        assert (loop.record.stem is not None) is loop.surroundings.stem_recorded
        assert np.ptp(loop.record.pv) > 0.0
        limited = np.mean((loop.record.op <= 0.0) | (loop.record.op >= 100.0))
        may = {effect.name for effect in loop.hidden} & {"saturation", "clip"}
        assert may or limited < 0.3, loop.cause


def test_what_is_given_is_a_loop_model_without_what_is_hidden(loops: list[HiddenLoop]) -> None:
    for loop in loops:
        model = LoopModel.from_mapping(loop.given)
        assert model.valves[0].effects == ()
        assert model.sensors == ((),)
        assert model.sample_time == loop.record.sample_time
        assert all(d.behaviour.effect == "coloured" for d in model.disturbances)


def test_a_model_that_is_off_is_so_by_some_per_cent_and_nothing_else_changes() -> None:
    for seed in SEEDS[:10]:
        exact, off = hidden_loop(seed), hidden_loop(seed, given="off")
        assert np.array_equal(exact.record.pv, off.record.pv)
        assert exact.hidden == off.hidden
        assert exact.known == exact.base.plant
        ratio = off.known.gain / off.base.plant.gain
        assert 0.03 <= abs(ratio - 1.0) <= 0.1
        for wrong, true in zip(off.known.lags, off.base.plant.lags, strict=True):
            assert 0.03 <= abs(wrong / true - 1.0) <= 0.1


def test_families_hold_what_they_say() -> None:
    for seed in SEEDS[:8]:
        two = hidden_loop(seed, "two").hidden
        assert len(two) == 2
        assert two[1].place in (LOAD, "disturbance:PV1")
        (friction,) = hidden_loop(seed, "physics").hidden
        assert friction.mechanical
        assert friction.key == (VALVE, "stiction")


@pytest.mark.trial
def test_every_kind_of_effect_changes_the_loop() -> None:
    """Each kind, hidden in one of many loops, makes another PV than the healthy loop has."""
    changed: set[str] = set()
    for seed in range(900, 1000):
        for family in ("single", "physics"):
            loop = hidden_loop(seed, family)
            if not loop.hidden or loop.cause in changed:
                continue
            (effect,) = loop.hidden
            if effect.name == "time_shift":
                changed.add(loop.cause)
                continue
            count = len(loop.op)
            zeros = np.zeros(count)
            path = 50.0 + 8.0 * np.sin(np.arange(count) / 9.0) + np.arange(count) / count
            by_hand = np.full(count, np.nan) if effect.name == "tuning" else path
            unit = 2.0 * loop.unit
            set_point = 50.0 + unit * (np.arange(count) % 200 < 100)
            signals = Signals(set_point, zeros, zeros, by_hand)
            healthy, hit = run(loop.base, signals), run(loop.base, signals, loop.hidden)
            if np.abs(hit.pv - healthy.pv)[LEAD:].max() > 0.01 * loop.unit:
                changed.add(loop.cause)
    known = set(KINDS)
    assert {cause.replace(" quadratic", "") for cause in changed} <= known
    assert len(changed) > 25


def test_friction_holds_the_stem_and_a_load_adds_to_it() -> None:
    loop = hidden_loop(900)
    count = 400
    op = np.full(count, 50.0)
    op[LEAD:] = 52.0
    zeros = np.zeros(count)
    signals = Signals(np.full(count, 50.0), zeros, zeros, op)
    stuck = Effect(VALVE, "stiction", {"f_s": 5.0, "f_d": 1.0})
    assert np.ptp(run(loop.base, signals, [stuck]).stem) == 0.0
    base = dataclasses.replace(loop.base)
    by_load = run(base, signals, [stuck, Effect(LOAD, "step", {"time": 0.0, "size": 2.0})])
    free = run(base, signals)
    assert by_load.clean == pytest.approx(free.clean)


def test_a_recorded_stem_is_where_the_valve_stands_after_each_op(loops: list[HiddenLoop]) -> None:
    shown = [loop for loop in loops if loop.record.stem is not None]
    assert 0 < len(shown) < 15
    for loop in shown:
        assert loop.record.stem is not None
        of_valve = any(effect.place == VALVE for effect in loop.hidden)
        away = np.abs(loop.record.stem - loop.record.op).max()
        if of_valve:
            assert away > 0.3
        elif loop.every == 1 and loop.surroundings.keeping != "op_rounded":
            assert away <= 0.026


def test_unknown_values_are_refused() -> None:
    with pytest.raises(InputError, match="family"):
        hidden_loop(1, "three")
    with pytest.raises(InputError, match="given"):
        hidden_loop(1, given="wrong")
    with pytest.raises(InputError, match="seed"):
        hidden_loop(-1)
    assert FAMILIES == ("single", "two", "physics")
