import copy
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from stiction_ros.config_files import config_directories
from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError
from stiction_ros.loop import Instrument, LoopModel

LOOPS = sorted(config_directories()[0].glob("*.loop.yaml"))
every_loop = pytest.mark.parametrize("path", LOOPS, ids=lambda path: path.name)

FULL: dict[str, Any] = {
    "loop": "full",
    "sample_time": 2.0,
    "valves": [
        {"name": "V1", "limits": [0.0, 100.0], "effects": []},
        {"name": "V2", "effects": [{"effect": "stiction", "law": "he", "f_s": 5.0, "f_d": 2.0}]},
    ],
    "process": {
        "kind": "arx",
        "outputs": [
            {
                "name": "PV1",
                "a": [-0.9],
                "b": {"V1": [0.1], "V2": [0.2, 0.1]},
                "delay": {"V2": 3},
                "bias": 0.5,
                "noise": {"std": 0.01, "enters": "equation"},
                "range": [0.0, 20.0],
                "rate_limit": 0.25,
            }
        ],
    },
    "sensors": [{"name": "PV1", "effects": [{"effect": "drift", "rate": 0.1}]}],
    "disturbances": [{"output": "PV1", "effect": "step", "time": 4.0, "size": 1.0}],
    "operating_point": {"op": {"V1": 40.0, "V2": 60.0}, "pv": {"PV1": 7.0}},
    "initial": {"stem": {"V2": 58.0}, "pv": {"PV1": 6.5}},
    "controller": {"kind": "pi", "gain": -0.5, "integral_time": 20.0},
    "provenance": [{"valve": "V2", "effect": "stiction", "from": "somewhere"}],
    "valid_from": 12,
}
STATE_SPACE: dict[str, Any] = {
    "loop": "ss",
    "sample_time": 1.0,
    "valves": [{"name": "V1"}],
    "process": {
        "kind": "state_space",
        "a": [[0.5, 0.0], [0.1, 0.8]],
        "b": [[1.0], [0.0]],
        "c": [[0.0, 1.0]],
        "e": [[0.1], [0.2]],
        "outputs": [{"name": "PV1"}],
        "measured_disturbances": ["D1"],
    },
}
TANK: dict[str, Any] = {
    "loop": "tank",
    "sample_time": 60.0,
    "valves": [{"name": "V1"}, {"name": "V2"}],
    "process": {"kind": "stirred_tank", "measured_disturbances": ["F_B"]},
}


def changed(document: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """``document`` with ``value`` at ``path``, such as ``valves.0.limits``."""
    out = copy.deepcopy(document)
    node: Any = out
    *way, last = (int(part) if part.isdecimal() else part for part in path.split("."))
    for part in way:
        node = node[part]
    node[last] = value
    return out


def without(document: dict[str, Any], path: str) -> dict[str, Any]:
    out = copy.deepcopy(document)
    node: Any = out
    *way, last = (int(part) if part.isdecimal() else part for part in path.split("."))
    for part in way:
        node = node[part]
    del node[last]
    return out


def refused(document: Any) -> str:
    """The one line that says why ``document`` is no loop model."""
    with pytest.raises(InputError) as caught:
        LoopModel.from_mapping(document, "x.loop.yaml")
    line = str(caught.value)
    assert line.startswith("x.loop.yaml")
    assert "\n" not in line
    return line


# ---- what is read ------------------------------------------------------------------------------


@every_loop
def test_a_config_survives_the_round_trip(path: Path, tmp_path: Path) -> None:
    model = LoopModel.load(path)
    model.save(tmp_path / "again.loop.yaml")
    again = LoopModel.load(tmp_path / "again.loop.yaml")
    assert again.to_mapping() == model.to_mapping() == yaml.safe_load(path.read_text())
    assert again.to_yaml() == model.to_yaml()


@every_loop
def test_a_config_starts_at_its_operating_point_or_where_it_says(path: Path) -> None:
    model = LoopModel.load(path)
    said = yaml.safe_load(path.read_text(encoding="utf-8")).get("initial", {})
    stems = dict(zip(model.valve_names, model.op0, strict=True)) | said.get("stem", {})
    outputs = dict(zip(model.outputs, model.pv0, strict=True)) | said.get("pv", {})
    assert model.stem_start.tolist() == list(stems.values())
    assert model.pv_start.tolist() == list(outputs.values())


def test_every_key_reaches_the_model() -> None:
    model = LoopModel.from_mapping(FULL)
    assert (model.name, model.sample_time) == ("full", 2.0)
    assert model.valve_names == ("V1", "V2")
    assert model.outputs == ("PV1",)
    assert model.limits.tolist() == [[0.0, 100.0], [-np.inf, np.inf]]
    assert model.valves[1].effects == (HeStiction(5.0, 2.0),)
    assert [e.title() for e in model.sensors[0]] == ["drift"]
    assert [(d.place, d.behaviour.title()) for d in model.disturbances] == [("PV1", "step")]
    assert (model.op0.tolist(), model.pv0.tolist()) == ([40.0, 60.0], [7.0])
    assert (model.stem_start.tolist(), model.pv_start.tolist()) == ([40.0, 58.0], [6.5])
    assert model.controller is not None
    assert (model.controller.gain, model.controller.integral_time) == (-0.5, 20.0)
    assert model.provenance == ({"valve": "V2", "effect": "stiction", "from": "somewhere"},)
    assert model.instruments == (Instrument(0.0, 20.0, 0.25),)
    assert LoopModel.from_yaml(model.to_yaml()).to_mapping() == FULL


def test_an_instrument_that_is_not_described_has_no_limits() -> None:
    assert LoopModel.from_mapping(STATE_SPACE).instruments == (Instrument(),)
    assert LoopModel.from_mapping(TANK).instruments == (Instrument(), Instrument())


def test_instruments_are_in_the_order_of_the_outputs() -> None:
    outputs = [{"name": "C"}, {"name": "T", "rate_limit": 2.0}]
    model = LoopModel.from_mapping(changed(TANK, "process.outputs", outputs))
    assert model.instruments == (Instrument(), Instrument(rate_limit=2.0))


def test_the_tank_starts_at_its_nominal_point() -> None:
    model = LoopModel.from_mapping(TANK)
    assert model.stem_start.tolist() == [50.0, 50.0]
    assert model.pv_start == pytest.approx([7.5, 42.324], abs=5e-4)


def test_valid_from_goes_into_the_text_only() -> None:
    model = LoopModel.from_mapping(TANK)
    text = model.to_yaml(valid_from=7)
    assert yaml.safe_load(text)["valid_from"] == 7
    assert "valid_from" not in model.to_mapping()


def test_a_model_keeps_nothing_of_the_mapping_it_came_from() -> None:
    mine = copy.deepcopy(FULL)
    model = LoopModel.from_mapping(mine)
    mine["valves"][0]["name"] = "V9"
    model.to_mapping()["valves"][0]["name"] = "V8"
    assert model.to_mapping() == FULL


def test_new_valve_effects_leave_the_model_they_came_from() -> None:
    model = LoopModel.from_mapping(FULL)
    sticky = model.with_valve_effects({"V1": [HeStiction(3.0, 1.0)]}, by="test")
    assert sticky.valves[0].effects == (HeStiction(3.0, 1.0),)
    assert sticky.valves[1].effects == model.valves[1].effects
    assert sticky.provenance[-1] == {"by": "test"}
    assert model.to_mapping() == FULL


def test_ideal_valves_have_no_effects() -> None:
    ideal = LoopModel.from_mapping(FULL).with_ideal_valves()
    assert all(valve.effects == () for valve in ideal.valves)


def test_effects_of_a_valve_that_is_not_there_are_refused() -> None:
    with pytest.raises(InputError, match="no valve 'V7'"):
        LoopModel.from_mapping(FULL).with_valve_effects({"V7": []})


# ---- what is refused ---------------------------------------------------------------------------

LEVELS = [
    (FULL, ""),
    (FULL, "valves.0"),
    (FULL, "valves.1.effects.0"),
    (FULL, "process"),
    (FULL, "process.outputs.0"),
    (FULL, "process.outputs.0.b"),
    (FULL, "process.outputs.0.delay"),
    (FULL, "process.outputs.0.noise"),
    (FULL, "sensors.0"),
    (FULL, "sensors.0.effects.0"),
    (FULL, "disturbances.0"),
    (FULL, "operating_point"),
    (FULL, "operating_point.op"),
    (FULL, "operating_point.pv"),
    (FULL, "initial"),
    (FULL, "initial.stem"),
    (FULL, "initial.pv"),
    (FULL, "controller"),
    (STATE_SPACE, "process"),
    (STATE_SPACE, "process.outputs.0"),
    (TANK, "process"),
]


@pytest.mark.parametrize(
    ("document", "level"), LEVELS, ids=lambda v: v if isinstance(v, str) else ""
)
def test_a_misspelt_key_is_named_at_every_level(document: dict[str, Any], level: str) -> None:
    line = refused(changed(document, f"{level}.spede".lstrip("."), 1.0))
    assert "unknown key 'spede'" in line
    assert "known keys" in line
    for name in re.findall("[a-z_]+", level)[:1]:
        assert name in line


NUMBERS = [
    (FULL, "sample_time"),
    (FULL, "valves.0.limits.1"),
    (FULL, "valves.1.effects.0.f_s"),
    (FULL, "process.outputs.0.a.0"),
    (FULL, "process.outputs.0.b.V2.1"),
    (FULL, "process.outputs.0.bias"),
    (FULL, "process.outputs.0.noise.std"),
    (FULL, "process.outputs.0.range.0"),
    (FULL, "process.outputs.0.rate_limit"),
    (FULL, "sensors.0.effects.0.rate"),
    (FULL, "disturbances.0.size"),
    (FULL, "operating_point.op.V1"),
    (FULL, "operating_point.pv.PV1"),
    (FULL, "initial.stem.V2"),
    (FULL, "initial.pv.PV1"),
    (FULL, "controller.gain"),
    (FULL, "controller.integral_time"),
    (STATE_SPACE, "process.a.0.1"),
    (STATE_SPACE, "process.b.0.0"),
    (STATE_SPACE, "process.c.0.0"),
    (STATE_SPACE, "process.e.0.0"),
    (TANK, "process.volume"),
]


@pytest.mark.parametrize(
    ("document", "place"), NUMBERS, ids=lambda v: v if isinstance(v, str) else ""
)
@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 10**400, "much", None, True, [1.0]])
def test_what_is_no_finite_number_is_refused_with_its_key(
    document: dict[str, Any], place: str, bad: object
) -> None:
    if bad is None and place in ("process.volume", "process.outputs.0.rate_limit"):
        pytest.skip("an absent parameter takes its default")
    line = refused(changed(document, place, bad))
    key = [part for part in place.split(".") if not part.isdecimal()][-1]
    assert key in line


WRONG = {
    "f_d above f_s": (changed(FULL, "valves.1.effects.0.f_d", 6.0), "larger than f_s"),
    "unknown effect": (changed(FULL, "valves.1.effects.0.effect", "glue"), "unknown effect"),
    "unknown law": (changed(FULL, "valves.1.effects.0.law", "she"), "unknown law"),
    "effect is text": (changed(FULL, "valves.1.effects", ["stiction"]), "expected keys"),
    "unknown kind": (changed(FULL, "process.kind", "tank"), "unknown value 'tank'"),
    "no loop": (without(FULL, "loop"), "lacks 'loop'"),
    "loop is a number": (changed(FULL, "loop", 5), "5 is no name"),
    "no sample time": (without(FULL, "sample_time"), "lacks 'sample_time'"),
    "sample time zero": (changed(FULL, "sample_time", 0.0), "out of range"),
    "sample time negative": (changed(FULL, "sample_time", -1.0), "out of range"),
    "no valves": (changed(FULL, "valves", []), "at least one valve"),
    "valves are a mapping": (changed(FULL, "valves", {"V1": {}}), "is no list"),
    "valve twice": (changed(FULL, "valves.1.name", "V1"), "name of its own"),
    "no process": (without(FULL, "process"), "lacks 'process'"),
    "process is a list": (changed(FULL, "process", []), "expected keys"),
    "no outputs": (changed(FULL, "process.outputs", []), "no output"),
    "output twice": (changed(FULL, "process.outputs", FULL["process"]["outputs"] * 2), "one name"),
    "b names a stranger": (changed(FULL, "process.outputs.0.b", {"V9": [1.0]}), "V9"),
    "b is empty": (changed(FULL, "process.outputs.0.b.V1", []), "empty"),
    "b is a number": (changed(FULL, "process.outputs.0.b.V1", 0.1), "no list"),
    "delay negative": (changed(FULL, "process.outputs.0.delay.V2", -1), "use ≥ 0"),
    "delay broken": (changed(FULL, "process.outputs.0.delay.V2", 1.5), "whole number"),
    "noise negative": (changed(FULL, "process.outputs.0.noise.std", -0.1), "out of range"),
    "noise elsewhere": (changed(FULL, "process.outputs.0.noise.enters", "valve"), "unknown value"),
    "range crossed": (changed(FULL, "process.outputs.0.range", [5.0, 5.0]), "not below"),
    "range short": (changed(FULL, "process.outputs.0.range", [5.0]), "has 1 values"),
    "rate zero": (changed(FULL, "process.outputs.0.rate_limit", 0.0), "out of range"),
    "limits crossed": (changed(FULL, "valves.0.limits", [100.0, 0.0]), "not below"),
    "limits short": (changed(FULL, "valves.0.limits", [100.0]), "has 1 values"),
    "sensor of nobody": (changed(FULL, "sensors.0.name", "PV9"), "unknown value 'PV9'"),
    "disturbance nowhere": (without(FULL, "disturbances.0.output"), "one output or one input"),
    "disturbance of nobody": (changed(FULL, "disturbances.0.output", "PV9"), "'PV9'"),
    "controller unknown": (changed(FULL, "controller.kind", "pid"), "unknown value 'pid'"),
    "integral time zero": (changed(FULL, "controller.integral_time", 0.0), "out of range"),
    "valid_from is text": (changed(FULL, "valid_from", "noon"), "valid_from"),
    "arx has measured disturbances": (
        changed(FULL, "process.measured_disturbances", ["D"]),
        "state_space",
    ),
    "ragged matrix": (changed(STATE_SPACE, "process.a", [[0.5], [0.1, 0.8]]), "row 2"),
    "a not square": (changed(STATE_SPACE, "process.a", [[0.5, 0.0]]), "shape"),
    "b too short": (changed(STATE_SPACE, "process.b", [[1.0]]), "b"),
    "b too wide": (changed(STATE_SPACE, "process.b", [[1.0, 0.0], [0.0, 1.0]]), "b"),
    "c too wide": (changed(STATE_SPACE, "process.c", [[1.0, 0.0, 0.0]]), "c"),
    "e without names": (without(STATE_SPACE, "process.measured_disturbances"), "columns"),
    "measured is a text": (changed(STATE_SPACE, "process.measured_disturbances", "D"), "no list"),
    "measured is a number": (changed(STATE_SPACE, "process.measured_disturbances", 5), "no list"),
    "measured twice": (
        changed(STATE_SPACE, "process.measured_disturbances", ["D", "D"]),
        "two inputs have one name",
    ),
    "sensor twice": (changed(FULL, "sensors", FULL["sensors"] * 2), "there twice"),
    "empty matrix": (changed(STATE_SPACE, "process.a", []), "rows"),
    "one valve for a tank": (changed(TANK, "valves", [{"name": "V1"}]), "two valves"),
    "tank about a point": (TANK | {"operating_point": {"op": {"V1": 40.0}}}, "absolute units"),
    "tank with a stranger": (
        changed(TANK, "process.measured_disturbances", ["F_A"]),
        "unknown disturbance",
    ),
    "tank without volume": (changed(TANK, "process.volume", 0.0), "out of range"),
    "nothing": (None, "expected keys"),
    "a list": ([1, 2], "expected keys"),
    "a number": (5, "expected keys"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_model_gets_one_line_that_says_what(case: str) -> None:
    document, said = WRONG[case]
    assert said in refused(document)


FILES = {
    "broken brackets": "loop: [1",
    "tabs": "loop:\n\t- a",
    "a date that is none": "loop: 2026-13-01",
    "control characters": "loop: \x00",
    "unhashable key": "? [a, b]\n: 1",
    "deep": "[" * 5000,
    "empty": "",
    "unknown tag": "loop: !!python/object:os.system x",
}


@pytest.mark.parametrize("case", FILES)
def test_a_file_that_is_no_yaml_gets_one_line_with_its_name(case: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.loop.yaml"
    path.write_text(FILES[case])
    with pytest.raises(InputError) as caught:
        LoopModel.load(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_file_that_is_no_text_gets_one_line_with_its_name(tmp_path: Path) -> None:
    path = tmp_path / "bad.loop.yaml"
    path.write_bytes(b"\xff\xfe\x00loop")
    with pytest.raises(InputError) as caught:
        LoopModel.load(path)
    assert str(caught.value).startswith(str(path))


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    for path in (tmp_path / "none.loop.yaml", tmp_path):
        with pytest.raises(InputError) as caught:
            LoopModel.load(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_number_that_yaml_takes_for_text_says_how_to_write_it() -> None:
    for written, better in (("1e-3", "0.001"), ("1e-7", "1.0e-07")):
        with pytest.raises(InputError) as caught:
            LoopModel.from_yaml(f"loop: x\nsample_time: {written}\n")
        assert caught.value.fix == f"write {better}"
        assert yaml.safe_load(better) == float(written)
