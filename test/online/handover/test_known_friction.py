import pytest

from stiction_ros.config_files import find_config
from stiction_ros.control import FrictionSpread
from stiction_ros.effects import HeStiction, KanoStiction
from stiction_ros.loop import LoopModel
from stiction_ros.online.handover.known_friction import frictions_of, spreads_of

PROCESS = LoopModel.load(find_config("example1_process.loop.yaml"))
FRICTION = HeStiction(5.0, 2.0)


def known(**provenance: object) -> LoopModel:
    return PROCESS.with_valve_effects({"V1": [FRICTION]}, **provenance)


def test_frictions_are_found_by_name() -> None:
    assert frictions_of(known(), ("V0", "V1")) == (None, FRICTION)


def test_any_law_of_stiction_is_found() -> None:
    model = PROCESS.with_valve_effects({"V1": [KanoStiction(7.0, 3.0)]})
    assert frictions_of(model, ("V1",)) == (KanoStiction(7.0, 3.0),)


def test_spreads_are_the_longer_halves_of_the_intervals() -> None:
    model = known(valve="V1", effect="stiction", f_s_interval=[4.9, 5.3], f_d_interval=[1.5, 2.1])
    (spread,) = spreads_of(model, ("V1",))
    assert spread is not None
    assert (spread.static, spread.dynamic) == pytest.approx((0.3, 0.5))


@pytest.mark.parametrize(
    "entry",
    [
        {},
        {"valve": "V2", "f_s_interval": [4.9, 5.3], "f_d_interval": [1.5, 2.1]},
        {"valve": "V1", "f_s_interval": [4.9, 5.3]},
        {"valve": "V1", "f_s_interval": [5.1, 5.3], "f_d_interval": [1.5, 2.1]},
        {"valve": "V1", "f_s_interval": ["a", 5.3], "f_d_interval": [1.5, 2.1]},
        {"valve": "V1", "f_s_interval": 5.0, "f_d_interval": [1.5, 2.1]},
    ],
)
def test_intervals_that_are_not_of_this_friction_do_not_count(entry: dict[str, object]) -> None:
    assert spreads_of(known(effect="stiction", **entry), ("V1",)) == (None,)


def test_the_last_entry_of_a_valve_counts() -> None:
    first = {"valve": "V1", "effect": "stiction", "f_s_interval": [4, 6], "f_d_interval": [1, 3]}
    second = first | {"f_s_interval": [4.5, 5.5]}
    model = known(**first).with_valve_effects({}, **second)
    assert spreads_of(model, ("V1",)) == (FrictionSpread(0.5, 1.0),)
