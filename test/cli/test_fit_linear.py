"""`stiction simulate --moves prbs` and `stiction fit-linear`, the paper's step repeated."""

import dataclasses
import json
import shlex
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.cli.main import main
from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel
from stiction_ros.loop.plant import Plant
from stiction_ros.online.controller.live import LiveController
from stiction_ros.online.session import Scenario

COLUMNS = shlex.split("--op V1=V1.OP --op V2=V2.OP --pv C=C.PV --pv T=T.PV")
PRBS = ["simulate", "tank.loop.yaml", "--moves", "prbs"]


@pytest.fixture(scope="module")
def prbs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("experiment") / "prbs.csv"
    assert main([*PRBS, "--seed", "1", "--samples", "600", "--out", str(path)]) == 0
    return path


def test_random_moves_say_how_to_read_its_record(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "prbs.csv"
    assert main([*PRBS, "--samples", "300", "--out", str(path)]) == 0
    command = shlex.split(capsys.readouterr().err.splitlines()[-1])
    assert command[0] == "stiction"
    assert main([*command[1:], "--order", "2", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["samples"] == 300


def test_fit_linear_prints_the_contract_as_json(
    prbs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fit-linear", str(prbs), *COLUMNS, "--delay", "0", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["record"] == str(prbs)
    assert found["model"]["kind"] == "state_space"
    gains = [list(output["gain"].values()) for output in found["outputs"]]
    assert np.array(gains) == pytest.approx(np.array([[0.025, 0.0], [-0.173, 0.297]]), abs=0.03)


def test_the_table_shows_order_both_fits_and_gains(
    prbs: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    assert main(["fit-linear", str(prbs), *COLUMNS, "--delay", "0"]) == 0
    shown = capsys.readouterr().out
    for text in ("of order", "one step %", "free run %", "gain V1", "gain V2"):
        assert text in shown


def test_loop_model_that_is_written_runs_the_tank(prbs: Path, tmp_path: Path) -> None:
    path = tmp_path / "found.loop.yaml"
    arguments = ["fit-linear", str(prbs), *COLUMNS, "--delay", "0"]
    assert main([*arguments, "--limits", "0:100", "--out", str(path)]) == 0
    model = LoopModel.load(path)
    assert model.name == "found"
    scenario = Scenario.load(find_config("tank.scenario.yaml"))
    settings = dataclasses.replace(scenario.controller, mode="unaware")
    controller = LiveController(settings, model)
    plant = Plant(LoopModel.load(find_config("tank.loop.yaml")).with_ideal_valves(), seed=1)
    sp = np.array([7.6, 43.0])
    for _ in range(150):
        measurement = plant.measure()
        plant.apply(controller.step(measurement.pv, sp, measurement.dv).op)
    assert plant.measure().pv_clean == pytest.approx(sp, abs=0.02)


def test_record_without_model_is_exit_1(tmp_path: Path) -> None:
    random = np.random.default_rng(4)
    op = 50.0 + 5.0 * np.sign(np.sin(np.arange(300) / 5.0 + random.random(300)))
    pv = np.zeros(300)
    for k in range(1, 300):
        pv[k] = 1.03 * pv[k - 1] + 0.1 * (op[k - 1] - 50.0) + 0.01 * random.standard_normal()
    path, out = tmp_path / "growing.csv", tmp_path / "no.loop.yaml"
    rows = np.column_stack([np.arange(300), op, pv])
    np.savetxt(path, rows, delimiter=",", header="t,OP,PV", comments="")
    assert main(["fit-linear", str(path), "--order", "1", "--delay", "0", "--out", str(out)]) == 1
    assert not out.exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["fit-linear", "no.csv"],
        [*PRBS, "--samples", "0", "--out", "x.csv"],
        [*PRBS, "--samples", "5", "--seed", "-1", "--out", "x.csv"],
        ["simulate", "no.yaml", "--moves", "prbs", "--out", "x.csv"],
    ],
)
def test_what_cannot_be_used_is_one_line_and_exit_2(
    arguments: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize("text", ["100:0", "0", "a:b", "0:inf"])
def test_limits_are_checked(text: str, prbs: Path) -> None:
    with pytest.raises(SystemExit) as end:
        main(["fit-linear", str(prbs), "--limits", text])
    assert end.value.code == 2
