"""What `from stiction_ros import …` gives, and that its documentation is true."""

import dataclasses
import doctest
import enum
import inspect
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import stiction_ros
from stiction_ros.control.result import StepStatus

NAMES = [name for name in stiction_ros.__all__ if name != "__version__"]
FUNCTIONS = [name for name in NAMES if inspect.isfunction(getattr(stiction_ros, name))]
LINES = 9  # that an example may have


def documentation(name: str) -> str:
    return inspect.getdoc(getattr(stiction_ros, name)) or ""


def test_every_name_is_there_and_listed() -> None:
    assert len(NAMES) >= 25
    assert sorted(stiction_ros.__all__) == stiction_ros.__all__
    assert set(NAMES) <= set(dir(stiction_ros))
    for name in NAMES:
        assert getattr(stiction_ros, name) is not None


def test_another_name_is_refused_as_python_does() -> None:
    with pytest.raises(AttributeError, match="no attribute 'stick'"):
        stiction_ros.stick  # noqa: B018


def test_a_name_loads_its_own_floor_alone() -> None:
    code = "import sys; from stiction_ros import LoopModel, simulate; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    loaded = set(done.stdout.split())
    assert "stiction_ros.loop" in loaded
    assert not {"scipy", "numba", "stiction_ros.identification"} & loaded


def test_the_package_says_that_it_is_typed() -> None:
    assert (Path(stiction_ros.__file__).parent / "py.typed").is_file()


@pytest.mark.parametrize("name", ["__init__", *NAMES])
def test_every_example_is_short_and_true(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    value: Any = stiction_ros if name == "__init__" else getattr(stiction_ros, name)
    text = inspect.getdoc(value) or ""
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, 0)
    assert 1 <= len(example.examples) <= LINES, "an example of about five lines"
    said: list[str] = []
    failed, _ = doctest.DocTestRunner().run(example, out=said.append)
    assert not failed, "".join(said)


def test_a_value_shows_itself_in_a_line() -> None:
    from stiction_ros import ControlMode, LoopModel, Record, Scenario, StepResult, find_config

    model = LoopModel.load(find_config("flow.loop.yaml"))
    record = Record.from_arrays(2.0, np.zeros((900, 1)), np.zeros((900, 1)), name="FIC1")
    step = StepResult(StepStatus.SOLVED, "", ControlMode.UNAWARE, np.ones(1), None, np.zeros(1), 0)
    fit = stiction_ros.fit_linear(stiction_ros.simulate(model, samples=300))
    scenario = Scenario.load(find_config("siso.scenario.yaml"))
    assert repr(record) == "<Record FIC1: 900 samples of 2 s; OP of V1, PV of PV1>"
    assert repr(model) == "<LoopModel flow: arx from V1 to PV1, samples of 1 s>"
    assert repr(step) == "<StepResult solved, OP 1 %, unaware>"
    for value in (record, model, step, fit, scenario):
        assert len(repr(value)) < 120
        assert repr(value).startswith(f"<{type(value).__name__} ")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_argument_of_a_function_is_explained(name: str) -> None:
    text = documentation(name)
    arguments = section(text, "Args")
    for parameter in inspect.signature(getattr(stiction_ros, name)).parameters:
        assert re.search(rf"^(\w+, )*{parameter}(, \w+)*:", arguments, re.MULTILINE), parameter
    returned = inspect.signature(getattr(stiction_ros, name)).return_annotation
    if returned is not None:
        assert section(text, "Returns") or text.startswith("Return"), "says what it returns"
    assert section(text, "Raises")


@pytest.mark.parametrize("name", [name for name in NAMES if name not in FUNCTIONS])
def test_every_field_of_a_value_is_explained(name: str) -> None:
    value = getattr(stiction_ros, name)
    if isinstance(value, ModuleType) or issubclass(value, enum.Enum | Exception):
        return
    if not dataclasses.is_dataclass(value):
        return
    text = section(documentation(name), "Attributes")
    for field in dataclasses.fields(value):
        told = field.metadata.get("parameter") or field.metadata.get("setting")
        assert told or re.search(rf"^(\w+, )*{field.name}(, \w+)*:", text, re.MULTILINE), field.name


def section(text: str, head: str) -> str:
    """Return the body of a section of a docstring, one level less indented."""
    found = re.search(rf"^{head}:\n((?:(?: +.*)?\n?)*)", text, re.MULTILINE)
    if found is None:
        return ""
    return "\n".join(line[4:] for line in found.group(1).splitlines())
