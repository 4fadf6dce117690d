"""The examples for users: each runs, at a small size, and says what it promises."""

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from stiction_ros.effects import discovery

FOLDER = Path(__file__).resolve().parents[1] / "examples"
FILES = sorted(FOLDER.glob("*.py"))
USERS = ("control engineers", "maintenance planners", "researchers", "ROS engineers")
SCREEN = 72  # lines
LONG = (
    *("04_rank_many_loops", "05_fit_a_linear_model", "06_what_does_the_simulation_miss"),
    *("08_a_live_loop", "09_bags", "10_add_a_friction_law"),
)

# What it is called with here, and what its output must hold.
SMALL: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "01_is_it_the_valve": (
        {"samples": 600},
        (r"V1: sticky", r"friction f_S (3\.[89]|4\.[01])", r"9\d % of its movement"),
    ),
    "02_read_an_export": (
        {"samples": 400},
        (r"300 of 400 samples of 1 s, valve V101", r"only the longest good part"),
    ),
    "03_what_would_service_bring": (
        {"samples": 1000},
        (r"as it is +error +\d{4}", r"serviced +error +\d{3} ", r"gain halved"),
    ),
    "04_rank_many_loops": (
        {"samples": 700},
        (r"^FIC103 +sticky .*\nFIC102 +sticky .*\nFIC101 +healthy",),
    ),
    "05_fit_a_linear_model": (
        {"samples": 1000},
        (r"state_space, ok", r"C: fit \d\d", r"saved: \('C', 'T'\)"),
    ),
    "06_what_does_the_simulation_miss": (
        {"samples": 1000},
        (r"verdict: named", r"valve:V1 lacks backlash: band (2\.[89]|3\.[01])"),
    ),
    "07_control_a_sticky_valve": (
        {"samples": 400},
        (r"unaware +mean \|error\| [\d.]+\ninversion.*\nembedding +mean \|error\| [\d.]+",),
    ),
    "08_a_live_loop": (
        {"samples": 3300},
        (
            r"2499: sticky, f_S 5\.0",
            r"3004: embedding",
            r"error\| [01]\.\d+ over samples 504 to 3004",
        ),
    ),
    "09_bags": ({"samples": 600}, (r"/pv 600", r"metadata\.yaml", r"600 samples", r"V1 sticky")),
    "10_add_a_friction_law": (
        {"samples": 700},
        (
            r"^sticky\n.*static_friction=(3\.[89]|4\.[01]).*closing=1\.[34]",
            r"stiction \(lopsided\) has no jump form",
        ),
    ),
}


def load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"example_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def test_every_example_is_run_here() -> None:
    assert [path.stem for path in FILES] == sorted(SMALL)
    assert len(FILES) >= 10


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_it_fits_a_screen_and_says_whom_it_is_for(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= SCREEN
    assert any(f"For {user}" in text for user in USERS)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_it_uses_the_public_face(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    below = set(re.findall(r"^from (stiction_ros\.[\w.]+) import", text, re.MULTILINE))
    assert not below


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=pytest.mark.trial if path.stem in LONG else []) for path in FILES],
    ids=lambda path: path.stem,
)
def test_it_runs_and_says_what_it_promises(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if path.stem == "09_bags":
        pytest.importorskip("sensor_msgs", reason="the definitions are not installed")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(discovery, "_registered", [])  # put back afterwards
    given, wanted = SMALL[path.stem]
    load(path).main(**given)
    said = capsys.readouterr().out
    for pattern in wanted:
        assert re.search(pattern, said, re.MULTILINE), (pattern, said)


@pytest.mark.trial
def test_a_control_engineer_s_own_file_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    from stiction_ros import LoopModel, find_config, simulate, write_csv

    ideal = LoopModel.load(find_config("flow.loop.yaml")).with_ideal_valves()
    write_csv(simulate(ideal, samples=1500), "own.csv")
    load(FILES[0]).main(Path("own.csv"))
    assert "V1: healthy" in capsys.readouterr().out
    assert not Path("flow.csv").exists()
