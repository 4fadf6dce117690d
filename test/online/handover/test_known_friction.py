import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.config_files import find_config
from stiction_ros.control import FrictionSpread
from stiction_ros.effects import HeStiction, KanoStiction
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.handover.known_friction import (
    LONGEST_REASON,
    frictions_of,
    read_offer,
    spreads_of,
)

PROCESS = LoopModel.load(find_config("example1_process.loop.yaml"))
FRICTION = HeStiction(5.0, 2.0)
SOON = 10.0  # s of this process; without limits the worst take minutes

OWN = LoopModel.load(find_config("example1_process.loop.yaml"))
GOOD = find_config("example1.loop.yaml").read_text(encoding="utf-8")

BAD = {
    "empty": ("", "expected keys"),
    "broken": ("loop: [", "no valid YAML"),
    "control characters": ("loop: \x00", "no valid YAML"),
    "a list": ("- 1", "expected keys"),
    "long": (GOOD + "#" * 70_000, "characters"),
    "deep": ("loop: " + "[" * 5000, "deeper"),
    "deep and closed": ("loop: " + "[" * 30 + "]" * 30, "deeper"),
    "many keys": ("\n".join(f"k{i}: 1" for i in range(4000)), "keys and values"),
    "aliases": ("a: &a [1, 1]\nb: &b [*a, *a]\nc: &c [*b, *b]\nd: [*c, *c]\n", "aliases"),
    "an alias within itself": ("a: &a [*a]", "aliases"),
    "a merge": ("a: &a {x: 1}\nb:\n  <<: *a\n", "aliases"),
    "a python object": ("loop: !!python/object/apply:os.system [ls]", "no valid YAML"),
    "a huge number": (GOOD.replace("1.0", "9" * 5000, 1), "loop_model"),
    "a date that is none": ("loop: 2026-13-01", "no valid YAML"),
    "another sample time": (GOOD.replace("sample_time: 1.0", "sample_time: 2.0"), "sample time"),
    "a delay without end": (GOOD.replace("{V1: 5}", "{V1: 1000000000}"), "delay"),
    "a dead time without end": (GOOD.replace("delay: {V1: 5}", "dead_time: {V1: 1.0e+9}"), "delay"),
    "a long key": (GOOD + f"{'x' * 1000}: 1\n", "unknown key"),
    "valid_from is text": (GOOD + "valid_from: noon\n", "valid_from"),
}


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


def test_a_good_model_is_read() -> None:
    model = read_offer(GOOD + "valid_from: 12\n", OWN)
    assert model.name == "example1"
    assert model.document["valid_from"] == 12


@pytest.mark.parametrize("case", BAD)
def test_a_bad_one_is_refused_in_one_short_sentence(case: str) -> None:
    text, said = BAD[case]
    begin = time.process_time()
    with pytest.raises(InputError) as caught:
        read_offer(text, OWN)
    assert time.process_time() - begin < SOON
    assert said in str(caught.value)
    assert len(str(caught.value)) <= LONGEST_REASON + 1
    assert "\n" not in str(caught.value)


@given(st.text(max_size=200), st.integers(0, len(GOOD)), st.integers(0, 40))
def test_whatever_is_put_into_a_model_it_is_read_or_refused(
    junk: str, place: int, gone: int
) -> None:
    text = GOOD[:place] + junk + GOOD[place + gone :]
    try:
        said = read_offer(text, OWN).name
    except InputError as error:
        said = str(error)
    assert "\n" not in said
