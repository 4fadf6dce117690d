"""The script that shows which packages three calls enter."""

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
    assert "Behaviour.step" in found["effects"]  # one name, whatever law overrides it
    assert "HeStiction.step" not in found["effects"]
    assert found["records"][0].startswith("Record.")
    assert sys.getprofile() is None


@pytest.mark.trial
def test_three_calls_are_shown_and_every_exception_has_its_reason(
    ways: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ways.main(["--samples", "300"]) == 0
    lines = capsys.readouterr().out.splitlines()
    names = [line for line in lines if not line.startswith(" ")]
    assert names == [ways.IDENTIFY, ways.STEP, ways.GAP]
    counts = [line.strip() for line in lines if line.startswith("    ") and line[4] != " "]
    assert [line.split(",")[0] for line in counts] == [
        "identification 1",
        "online 1",
        "discrepancy 1",
    ]
    reasons = [line for line in lines if line.startswith("        because ")]
    assert len(reasons) == sum(len(each) for each in ways.REASONS.values())


def test_many_doors_want_a_reason_and_a_reason_wants_many_doors(ways: ModuleType) -> None:
    doors = {"loop": ["a", "b", "c"], "records": ["a", "b"]}
    assert ways.complaints("call", doors, {"loop": "it is so"}) == []
    (missing,) = ways.complaints("call", doors, {})
    assert "loop by 3 doors" in missing
    assert ways.complaints("call", doors, {"loop": " "}) == [missing]
    (stale,) = ways.complaints("call", doors, {"loop": "it is so", "records": "once"})
    assert "records by no more than 2" in stale
    (gone,) = ways.complaints("call", {}, {"loop": "it is so"})
    assert gone.startswith("call enters loop")
