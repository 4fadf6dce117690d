"""Loops whose model has one figure of the process wrong: exact, and judged to the letter."""

from typing import Any

import numpy as np
import pytest

from stiction_ros.cli.main import main
from stiction_ros.effects import FloatArray
from stiction_studies.blind.wrong_process import CASES, REST, Plant, is_named, wrong_process


def run_of(model: dict[str, Any], op: FloatArray) -> FloatArray:
    """Return PV by the difference equation of a loop model."""
    (output,) = model["process"]["outputs"]
    a, b, delay = output["a"], output["b"]["V1"], output["delay"]["V1"]
    y = np.zeros(len(op))
    for k in range(len(op)):
        y[k] = sum(c * (op[k - 1 - delay - i] - REST) for i, c in enumerate(b) if k > delay + i)
        y[k] -= sum(c * y[k - 1 - i] for i, c in enumerate(a) if k > i)
    return REST + y


@pytest.mark.parametrize("case", ["nothing", "order too low"])
def test_the_model_is_the_plant_but_for_one_figure(case: str) -> None:
    model, record, _ = wrong_process(3, case)
    left = record.pv[:, 0] - run_of(model, record.op[:, 0])
    declared = model["process"]["outputs"][0]["noise"]["std"]
    assert bool(np.std(left) < 1.1 * declared) is (case == "nothing")


def test_two_lags_are_one_after_the_other() -> None:
    model = Plant(2.0, 0, (4.0, 9.0)).model(1.0, 0.1, (1.0, 9.0))
    end = run_of(model, np.full(400, REST + 1.0))
    assert end[-1] - REST == pytest.approx(2.0)
    half = 2.0 * (1.0 - (9.0 * np.exp(-10.0 / 9.0) - 4.0 * np.exp(-10.0 / 4.0)) / 5.0)
    assert end[10] - REST == pytest.approx(half)


def said(what: str, value: float, verdict: str = "named") -> dict[str, Any]:
    return {"verdict": verdict, "process_changes": [{"what": what, "value": value}], "effects": []}


def test_the_size_counts_and_nothing_else_may_be_said() -> None:
    assert is_named(said("gain", 1.95), "gain x .5", 1.0, 5.0)
    assert not is_named(said("gain", 0.5), "gain x .5", 1.0, 5.0)
    assert is_named(said("delay", -6.1), "dead time + 3", 2.0, 5.0)
    assert not is_named(said("delay", -6.1, "unknown"), "dead time + 3", 2.0, 5.0)
    assert is_named(said("time_constant", 0.01), "order too high", 1.0, 5.0)
    assert not is_named(said("gain", 1.95), "nothing", 1.0, 5.0)
    lag = {"place": "process:PV1", "effect": "pole", "parameters": {"tau": 5.2}}
    answer = {"verdict": "named", "process_changes": [], "effects": [lag | {"alternatives": []}]}
    assert is_named(answer, "order too low", 1.0, 5.0)
    assert not is_named(answer, "order too low", 1.0, 9.0)


@pytest.mark.trial
def test_the_table_has_a_row_for_each_case(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "world", "--family", "process", "--first", "3", "--loops", "1"]) == 0
    printed = capsys.readouterr().out
    assert all(case in printed for case in CASES)


def test_the_family_is_run_by_itself(capsys: pytest.CaptureFixture[str]) -> None:
    families = ["--family", "process", "--family", "single"]
    assert main(["bench", "world", *families]) == 2
    assert "by itself" in capsys.readouterr().err
