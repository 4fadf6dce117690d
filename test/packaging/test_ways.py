"""The script that shows which packages three calls enter."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

import stiction_ros as st

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def ways() -> ModuleType:
    spec = importlib.util.spec_from_file_location("ways", ROOT / "tools" / "ways.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_doors_are_counted_where_another_package_calls(ways: ModuleType) -> None:
    model = st.LoopModel.load(st.find_config("flow.loop.yaml"))
    found = ways.ways_of(lambda: st.simulate(model, samples=20))
    assert next(iter(found)) == "loop"
    assert found["loop"] == ["simulate"]  # what it calls of its own package is no door
    assert "HeStiction.step" in found["effects"]
    assert found["records"][0].startswith("Record.")
    assert sys.getprofile() is None


def test_three_calls_are_shown(ways: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert ways.main(["--samples", "300"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("(")[0] for line in lines[::2]] == [
        "identify",
        "LiveController.step",
        "find_gap",
    ]
    firsts = [line.split(",")[0].strip() for line in lines[1::2]]
    assert firsts == ["identification 1", "online 1", "discrepancy 1"]
