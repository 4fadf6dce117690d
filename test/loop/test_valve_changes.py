from typing import Any

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel, Plant, ValveChange, read_valve_changes
from stiction_ros.loop.valve_changes import valve_changes_text

TANK = LoopModel.load(find_config("tank.loop.yaml"))
STICKY = {"effect": "stiction", "law": "he", "f_s": 3.0, "f_d": 1.0}
OPS = np.random.default_rng(3).uniform(30.0, 70.0, (60, 2))


def stems(changes: tuple[ValveChange, ...], ops: np.ndarray = OPS, seed: int = 1) -> np.ndarray:
    plant = Plant(TANK, seed, changes)
    return np.array([plant.apply(op) for op in ops])


def test_a_list_and_its_text_read_alike_in_the_order_of_their_times() -> None:
    value = [
        {"time": 90.0, "valve": "V2", "effects": [STICKY]},
        {"time": 30.0, "valve": "V1", "effects": []},
    ]
    listed = read_valve_changes(value, ("V1", "V2"))
    assert listed == read_valve_changes(valve_changes_text(value), ("V1", "V2"))
    assert [change.time for change in listed] == [30.0, 90.0]
    assert listed[1] == ValveChange(90.0, "V2", (HeStiction(3.0, 1.0),))
    assert "\n" not in valve_changes_text(value)


@pytest.mark.parametrize("value", ["", "  ", [], ()])
def test_nothing_given_changes_nothing(value: Any) -> None:
    assert read_valve_changes(value, ("V1",)) == ()


@pytest.mark.parametrize(
    ("value", "named"),
    [
        ([{"time": 1.0, "valve": "V3", "effects": []}], r"\[0\].valve: unknown value 'V3'"),
        ([{"time": -1.0, "valve": "V1", "effects": []}], "time: -1 is out of range"),
        ([{"time": 1.0, "valve": "V1"}], "lacks 'effects'"),
        ([{"time": 1.0, "valve": "V1", "effects": [{"effect": "rust"}]}], "rust"),
        ([{"time": 1.0, "valve": "V1", "effects": [], "size": 1}], "unknown key 'size'"),
        ({"time": 1.0}, "is no list of changes"),
        (3, "is no list of changes"),
        ("[{time: 1", "no valid YAML"),
        ("V1", "is no list of changes"),
    ],
)
def test_a_wrong_change_is_named(value: Any, named: str) -> None:
    with pytest.raises(InputError, match=named) as caught:
        read_valve_changes(value, ("V1",), "plant: valve_changes")
    assert str(caught.value).startswith("plant: valve_changes")


def test_the_valve_is_as_it_was_until_the_change_and_rests_where_it_stood() -> None:
    """Sample time 60 s: a change at 1190 s acts at sample 20 and not before."""
    before = stems(())
    changed = stems((ValveChange(1190.0, "V1", (HeStiction(20.0, 2.0),)),))
    assert np.array_equal(changed[:20], before[:20])
    law, memory = HeStiction(20.0, 2.0), before[19, 0]
    for k in range(20, 60):
        memory, stem = law.step(memory, OPS[k, 0])
        assert changed[k, 0] == stem
    assert np.array_equal(changed[:, 1], before[:, 1])


def test_a_serviced_valve_follows_op() -> None:
    changed = stems((ValveChange(600.0, "V1", ()),))
    assert np.array_equal(changed[10:, 0], OPS[10:, 0])
    assert not np.array_equal(changed[:10, 0], OPS[:10, 0])


def test_the_new_friction_holds_the_stem_where_the_old_one_left_it() -> None:
    ops = np.vstack([OPS[:10], np.tile(OPS[9], (10, 1))])
    changed = stems((ValveChange(600.0, "V1", (HeStiction(99.0, 0.0),)),), ops)
    assert np.all(changed[10:, 0] == changed[9, 0])


def test_several_changes_of_one_valve_follow_each_other() -> None:
    both = (ValveChange(600.0, "V1", ()), ValveChange(1200.0, "V1", (HeStiction(99.0, 0.0),)))
    changed = stems(both)
    assert np.array_equal(changed[10:20, 0], OPS[10:20, 0])
    assert np.all(changed[20:, 0] == OPS[19, 0])


def test_the_noise_does_not_depend_on_a_change() -> None:
    plants = Plant(TANK, 5), Plant(TANK, 5, (ValveChange(0.0, "V2", (HeStiction(5.0, 1.0),)),))
    for op in OPS:
        one, two = (plant.measure() for plant in plants)
        assert one.pv - one.pv_clean == pytest.approx(two.pv - two.pv_clean, abs=1e-12)
        for plant in plants:
            plant.apply(op)
