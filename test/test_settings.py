import dataclasses
import importlib
import math
import pkgutil
from typing import Any

import pytest

import stiction_ros
from stiction_ros import settings as settings_module
from stiction_ros.errors import InputError
from stiction_ros.settings import from_mapping, setting, settings_of


def _settings_classes() -> list[type[Any]]:
    """Every dataclass of the package that declares settings, ROS nodes included."""
    found: dict[str, type[Any]] = {}
    for info in pkgutil.walk_packages(stiction_ros.__path__, "stiction_ros."):
        if info.name.endswith("__main__"):
            continue
        try:
            module = importlib.import_module(info.name)
        except ModuleNotFoundError as error:
            if error.name is None or error.name.startswith("stiction_ros"):
                raise
            continue  # nodes without ROS
        for value in vars(module).values():
            if not (isinstance(value, type) and dataclasses.is_dataclass(value)):
                continue
            if any("setting" in field.metadata for field in dataclasses.fields(value)):
                found[f"{value.__module__}.{value.__qualname__}"] = value
    return [found[name] for name in sorted(found)]


every_class = pytest.mark.parametrize("cls", _settings_classes(), ids=lambda cls: str(cls.__name__))


@every_class
def test_every_field_is_a_documented_setting(cls: type[Any]) -> None:
    entries = settings_of(cls)
    assert [entry.name for entry in entries] == [field.name for field in dataclasses.fields(cls)]
    for entry in entries:
        assert len(entry.description) > 8, entry.name
        assert entry.low < entry.high, entry.name
        assert cls.__doc__


@every_class
def test_every_default_passes_its_own_check(cls: type[Any]) -> None:
    values = {e.name: e.default for e in settings_of(cls)}
    assert from_mapping(cls, values, "x.yaml") == cls()


@every_class
def test_a_misspelt_key_is_refused_with_the_known_ones(cls: type[Any]) -> None:
    name = settings_of(cls)[0].name
    with pytest.raises(InputError) as caught:
        from_mapping(cls, {f"{name}_x": 1}, "x.yaml")
    assert f"'{name}_x'" in caught.value.what
    assert name in caught.value.fix
    assert caught.value.where == "x.yaml"


@every_class
def test_values_of_the_wrong_type_are_refused(cls: type[Any]) -> None:
    wrong = {"float": "1", "int": 1.5, "bool": 1, "str": 1, "floats": 1.0, "strings": "a"}
    for entry in settings_of(cls):
        with pytest.raises(InputError) as caught:
            from_mapping(cls, {entry.name: wrong[entry.kind]}, "x.yaml")
        assert caught.value.where == f"x.yaml: {entry.name}"


@every_class
def test_values_out_of_range_are_refused(cls: type[Any]) -> None:
    for entry in settings_of(cls):
        beyond: list[Any] = []
        if entry.kind in ("float", "floats"):
            beyond.append(math.nan)
        if entry.kind in ("float", "floats", "int"):
            beyond += [v for v in (entry.low - 1, entry.high + 1) if math.isfinite(v)]
        if entry.choices:
            beyond.append("no such choice")
        for value in beyond:
            if entry.kind == "int":
                value = int(value)
            given = (value,) if entry.kind == "floats" else value
            with pytest.raises(InputError) as caught:
                from_mapping(cls, {entry.name: given}, "x.yaml")
            assert caught.value.where == f"x.yaml: {entry.name}"
            assert "\n" not in str(caught.value)


@dataclasses.dataclass(frozen=True)
class Example:
    """One setting of each kind."""

    gain: float = setting(1.0, "a number", low=0.0)
    count: int = setting(2, "a whole number", low=1, high=9)
    loud: bool = setting(False, "a flag")
    mode: str = setting("a", "a choice", choices=("a", "b"))
    weights: tuple[float, ...] = setting((1.0,), "a list of numbers", low=0.0)
    names: tuple[str, ...] = setting((), "a list of names")


def test_given_values_are_converted_and_others_keep_their_default() -> None:
    built = from_mapping(Example, {"gain": 3, "weights": [1, 2.5], "names": ["x"]}, "x.yaml")
    assert built == Example(gain=3.0, weights=(1.0, 2.5), names=("x",))
    assert isinstance(built.gain, float)


@pytest.mark.parametrize(
    "values",
    [
        {"gain": True},
        {"gain": -1.0},
        {"gain": 10**400},
        {"gain": None},
        {"count": True},
        {"count": 10},
        {"loud": "yes"},
        {"mode": "c"},
        {"weights": [1.0, -1.0]},
        {"weights": [1.0, "2"]},
        {"weights": [10**400]},
        {"weights": "1"},
        {"names": [1]},
        {"names": "x"},
    ],
)
def test_a_bad_value_is_refused_in_one_line_with_its_place(values: dict[str, Any]) -> None:
    with pytest.raises(InputError) as caught:
        from_mapping(Example, values, "x.yaml")
    assert caught.value.where == f"x.yaml: {next(iter(values))}"
    assert "\n" not in str(caught.value)


def test_a_setting_knows_its_declaration() -> None:
    entry = settings_module.settings_of(Example)[1]
    assert (entry.name, entry.kind, entry.default, entry.low, entry.high, entry.fixed) == (
        "count",
        "int",
        2,
        1,
        9,
        False,
    )


@dataclasses.dataclass(frozen=True)
class _Unlimited:
    weights: tuple[float, ...] = setting((1.0,), "weights", low=0.0)
    limits: tuple[float, ...] = setting((math.inf,), "limits", low=0.0)


def test_a_limit_may_be_infinite():
    assert from_mapping(_Unlimited, {"limits": [math.inf]}, "x").limits == (math.inf,)


def test_a_weight_may_not_be_infinite():
    with pytest.raises(InputError, match="weights"):
        from_mapping(_Unlimited, {"weights": [math.inf]}, "x")
