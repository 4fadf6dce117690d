"""Effects in the YAML of a loop, and in the plant that it describes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from stiction_ros.config_files import find_config
from stiction_ros.control_settings import ControlSettings
from stiction_ros.effects import Behaviour, behaviours, from_mapping
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel, simulate_open_loop

PLACES = ("valve", "load", "process", "disturbance", "sensor")
PAIRS = [(kind, place) for kind in behaviours() for place in PLACES if place in kind.places]
every_pair = pytest.mark.parametrize(
    ("kind", "place"), PAIRS, ids=[f"{p}-{k.title()}" for k, p in PAIRS]
)
LOOPS = ("example1_process.loop.yaml", "tank.loop.yaml", "tank_linear.loop.yaml")


def effect(kind: type[Behaviour], second: float = 1.0) -> Behaviour:
    """An effect of size 1.5, times and durations of 1.5 times ``second``."""
    head: dict[str, Any] = {"effect": kind.effect} | ({"law": kind.law} if kind.law else {})
    values = {p.key: 1.5 * second if p.unit == "s" else 1.5 for p in kind.parameters()}
    return from_mapping(head | values)


def tag(model: LoopModel, place: str) -> str:
    tags = model.valve_names if place in ("valve", "load") else model.outputs
    return f"{place}:{tags[0]}"


def run(model: LoopModel) -> np.ndarray:
    moves = model.op0 + np.random.default_rng(1).uniform(-30.0, 30.0, (40, len(model.op0)))
    return simulate_open_loop(model, moves, seed=4).record.pv


@every_pair
@pytest.mark.parametrize("name", LOOPS)
def test_every_effect_survives_yaml_and_moves_the_plant(
    kind: type[Behaviour], place: str, name: str
) -> None:
    model = LoopModel.load(find_config(name)).with_ideal_valves()
    more = model.with_effect(tag(model, place), effect(kind, model.sample_time), source="test")
    again = LoopModel.from_yaml(more.to_yaml())
    assert again.to_mapping() == more.to_mapping()
    assert again.provenance[-1] == {"source": "test"}
    pv = run(again)
    assert np.isfinite(pv).all()
    assert not np.array_equal(pv, run(model))


@pytest.mark.parametrize("name", LOOPS)
def test_a_controller_is_designed_on_an_altered_process(name: str) -> None:
    model = LoopModel.load(find_config(name))
    slow = model.with_effect(
        f"process:{model.outputs[0]}", from_mapping({"effect": "delay", "extra": 2.0})
    )
    settings = ControlSettings()
    assert settings.design(slow).model.order == settings.design(model).model.order + 2


@pytest.mark.parametrize("kind", behaviours(), ids=lambda kind: kind.title())
def test_only_effects_of_a_process_act_on_it(kind: type[Behaviour]) -> None:
    model = LoopModel.load(find_config("example1_process.loop.yaml"))
    if "process" in kind.places:
        assert hasattr(kind, "filter")
        model.with_effect("process:PV1", effect(kind))
        return
    with pytest.raises(InputError, match="cannot act on a process") as caught:
        model.with_effect("process:PV1", effect(kind))
    assert "outputs[0].effects[0]" in caught.value.where


@pytest.mark.parametrize("kind", behaviours(), ids=lambda kind: kind.title())
def test_an_effect_acts_at_its_places_alone(kind: type[Behaviour]) -> None:
    model = LoopModel.load(find_config("example1_process.loop.yaml"))
    for place in PLACES:
        if place in kind.places:
            model.with_effect(tag(model, place), effect(kind))
            continue
        with pytest.raises(InputError, match=rf"cannot act on a {place}; it acts on: "):
            model.with_effect(tag(model, place), effect(kind))


def test_an_effect_at_another_place_is_told_with_file_and_key(tmp_path: Path) -> None:
    model = LoopModel.load(find_config("flow.loop.yaml"))
    document = model.to_mapping()
    document["valves"][0]["effects"] = [{"effect": "bias_step", "time": 5.0, "size": 1.0}]
    path = tmp_path / "wrong.loop.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        LoopModel.load(path)
    said = "valves[0].effects[0]: effect: bias_step cannot act on a valve; it acts on: sensor"
    assert str(caught.value) == f"{path}: {said}"


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("valve:PV1", "no valve 'PV1'"),
        ("process:V1", "no process 'V1'"),
        ("load:PV1", "no load 'PV1'"),
        ("sensor:V1", "no sensor 'V1'"),
        ("disturbance:C_A", "no disturbance 'C_A'"),
        ("data:PV1", "no place"),
        ("V1", "no place"),
    ],
)
def test_a_wrong_place_is_named(place: str, said: str) -> None:
    model = LoopModel.load(find_config("example1_process.loop.yaml"))
    with pytest.raises(InputError, match=said) as caught:
        model.with_effect(place, from_mapping({"effect": "drift", "rate": 1.0}))
    assert caught.value.fix


@pytest.mark.parametrize("name", LOOPS)
def test_a_load_moves_the_process_as_its_stem_does_but_is_no_stem(name: str) -> None:
    model = LoopModel.load(find_config(name)).with_ideal_valves()
    moves = np.tile(model.op0, (40, 1))
    shifted = moves + np.eye(len(model.op0))[0] * 5.0
    step = from_mapping({"effect": "step", "time": 0.0, "size": 5.0})
    loaded = simulate_open_loop(model.with_effect(tag(model, "load"), step), moves, seed=4).record
    moved = simulate_open_loop(model, shifted, seed=4).record
    assert loaded.pv == pytest.approx(moved.pv, rel=1e-12)
    assert loaded.stem is not None
    assert np.array_equal(loaded.stem, moves)


def test_a_disturbance_may_sit_on_an_input_of_the_tank() -> None:
    model = LoopModel.load(find_config("tank.loop.yaml"))
    step = from_mapping({"effect": "step", "time": 0.0, "size": 0.2})
    assert not np.array_equal(run(model), run(model.with_effect("disturbance:F_B", step)))


def test_effects_are_added_behind_those_that_are_there() -> None:
    model = LoopModel.load(find_config("example1.loop.yaml"))
    more = model.with_effect("valve:V1", from_mapping({"effect": "offset", "size": 1.0}))
    assert [e.effect for e in more.valves[0].effects] == ["stiction", "offset"]


def test_a_coloured_disturbance_leaves_the_other_noise_as_it_was() -> None:
    model = LoopModel.load(find_config("example1_process.loop.yaml"))
    still = model.with_effect(
        "disturbance:PV1", from_mapping({"effect": "coloured", "std": 0.0, "tau": 10.0})
    )
    assert np.array_equal(run(still), run(model))


def test_a_coloured_disturbance_depends_on_the_seed_alone() -> None:
    model = LoopModel.load(find_config("example1_process.loop.yaml")).with_effect(
        "disturbance:PV1", from_mapping({"effect": "coloured", "std": 1.0, "tau": 10.0})
    )
    held = np.full((30, 1), 50.0)
    one, two, other = (simulate_open_loop(model, held, seed).record.pv for seed in (4, 4, 5))
    assert np.array_equal(one, two)
    assert not np.array_equal(one, other)
