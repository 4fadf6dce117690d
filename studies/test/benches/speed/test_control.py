"""`stiction bench control`: its rows, on few problems."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stiction_ros.cli.main import main
from stiction_studies.benches.speed import control as bench_control
from stiction_studies.benches.speed.control import FULL, ControlPlan, Loop, sticky_valves, tank

TINY = ControlPlan(problems=4, programmes=2, growth=2, horizons=(5,), valves=(1, 2))


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What the command writes."""
    path: Path = tmp_path_factory.mktemp("bench") / "rows.json"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench_control, "QUICK", TINY)
        assert main(["bench", "control", "--quick", "--seed", "3", "--json", str(path)]) == 0
    document = json.loads(path.read_text(encoding="utf-8"))
    assert document["name"] == "control"
    found: list[dict[str, Any]] = document["rows"]
    return found


@pytest.mark.trial
def test_every_comparison_has_its_row(rows: list[dict[str, Any]]) -> None:
    assert [(row["case"], row["subject"]) for row in rows] == [
        ("tank, N_H = 50", "SU"),
        ("tank, N_H = 50", "SE, exact"),
        ("tank, N_H = 5", "SU"),
        ("tank, N_H = 5", "SE, exact"),
        ("m = 1, all sticky", "SU"),
        ("m = 1, all sticky", "SE, exact"),
        ("m = 2, all sticky", "SU"),
        ("m = 2, all sticky", "SE, exact"),
    ]


@pytest.mark.trial
def test_ratio_is_baseline_over_subject(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        assert row["ratio"] == pytest.approx(row["baseline_ms"] / row["subject_ms"])
        assert row["p99_ms"] >= row["subject_ms"] > 0.0


def test_the_full_run_covers_what_was_asked() -> None:
    assert FULL.horizons == (10, 20, 50, 100, 200)
    assert FULL.valves == (1, 2, 3)


@pytest.fixture(scope="module")
def loop() -> Loop:
    return tank(3)


def unaware_ops(loop: Loop) -> list[Any]:
    design = loop.design()
    quadratic = bench_control.UnawareMpc(design.model, design.unaware, design.limits)
    problems = loop.problems(5, aware=False)
    return [quadratic.plan(at.state, at.target, at.stem).op for at in problems]  # type: ignore[union-attr]


def test_ipopt_solves_the_same_problem(loop: Loop) -> None:
    solver = bench_control._plain_ipopt(loop.design())
    theirs = [solver(at) for at in loop.problems(5, aware=False)]
    assert np.array(theirs) == pytest.approx(np.array(unaware_ops(loop)), abs=1e-5)


def test_problems_of_an_aware_controller_start_from_the_stem(loop: Loop) -> None:
    aware, unaware = (loop.problems(3, aware=kind) for kind in (True, False))
    assert np.array([at.stem for at in aware])[:, 0] != pytest.approx(
        np.array([at.stem for at in unaware])[:, 0]
    )


def test_loops_of_one_to_three_sticky_valves() -> None:
    assert [len(sticky_valves(1, m).model.valves) for m in (1, 2, 3)] == [1, 2, 3]


@pytest.mark.parametrize("option", [["--repeat", "2"], ["--longest", "500"], ["--seed", "-1"]])
def test_options_that_do_not_fit_are_refused(
    option: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "control", *option]) == 2
    assert option[0] in capsys.readouterr().err
