"""`stiction simulate`: a record of a loop under its own controller."""

from pathlib import Path

import numpy as np
import pytest
from as_given import open_record

from stiction_ros.cli.main import main
from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel, PiController, SetPoints, simulate, simulate_closed_loop
from stiction_ros.loop.closed_loop import own_controller

FLOW = find_config("flow.loop.yaml")
MOVES = find_config("flow.set_points.yaml")


def test_the_record_is_that_of_the_loop_under_its_pi(tmp_path: Path) -> None:
    out = tmp_path / "flow.csv"
    given = ["--set-points", str(MOVES), "--samples", "400", "--seed", "3", "--out", str(out)]
    assert main(["simulate", str(FLOW), *given]) == 0
    model = LoopModel.load(FLOW)
    assert model.controller is not None
    controller = PiController(model.controller, 1.0, 48.0, (0.0, 100.0))
    schedule = SetPoints.load(MOVES, model.outputs)
    wanted = simulate_closed_loop(model, controller, schedule, 400, 3).record
    found = open_record(out)
    for key in ("op", "pv", "sp", "stem"):
        assert np.array_equal(getattr(found, key), getattr(wanted, key)), key


def test_a_bag_and_a_csv_file_hold_the_same(tmp_path: Path) -> None:
    pytest.importorskip("sensor_msgs", reason="the definitions of sensor_msgs are not installed")
    for out in ("flow.csv", "bag"):
        arguments = ["simulate", str(FLOW), "--samples", "120", "--out", str(tmp_path / out)]
        assert main(arguments) == 0
    csv, bag = open_record(tmp_path / "flow.csv"), open_record(tmp_path / "bag")
    assert np.array_equal(csv.op, bag.op)
    assert np.array_equal(csv.pv, bag.pv)


def test_without_out_the_file_bears_the_loop_s_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "flow.loop.yaml", "--samples", "100"]) == 0
    assert len(open_record("flow.csv")) == 100
    said = capsys.readouterr().err
    assert "flow.csv: 100 samples of 1 s; the stem of V1 moved at" in said
    assert "stiction identify flow.csv" in said


def test_the_sticky_valve_makes_the_loop_cycle_and_an_ideal_one_does_not() -> None:
    model = LoopModel.load(FLOW)
    sticky = simulate(model, samples=1500, seed=2)
    ideal = simulate(model.with_ideal_valves(), samples=1500, seed=2)
    assert np.std(sticky.pv[500:]) > 3.0 * np.std(ideal.pv[500:])


def test_without_set_points_the_operating_point_is_held() -> None:
    record = simulate(LoopModel.load(FLOW), samples=50)
    assert record.sp is not None
    assert np.unique(record.sp).tolist() == [40.0]


def test_the_seed_is_that_of_the_noise() -> None:
    model = LoopModel.load(FLOW)
    one, same, other = (simulate(model, samples=80, seed=seed).pv for seed in (4, 4, 5))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_valves_without_limits_have_none() -> None:
    document = LoopModel.load(FLOW).to_mapping()
    del document["valves"][0]["limits"]
    model = LoopModel.from_mapping(document)
    assert own_controller(model).limits == (-np.inf, np.inf)


def test_set_points_of_another_loop_are_refused() -> None:
    other = SetPoints(("PV9",), np.zeros(1), np.zeros((1, 1)))
    with pytest.raises(InputError, match="set-points are of PV9"):
        simulate(LoopModel.load(FLOW), other, samples=10)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["example1.loop.yaml"], "has no controller of its own"),
        (["{two}"], "a pi controller serves one valve and one output, not 2 and 2"),
        (["flow.loop.yaml", "--samples", "1"], "1 is too few"),
        (["flow.loop.yaml", "--seed", "-1"], "-1 is negative"),
        (["flow.loop.yaml", "--set-points", "tank.set_points.yaml"], "tank.set_points.yaml"),
        (["nowhere.loop.yaml"], "no such file"),
    ],
)
def test_what_cannot_be_simulated_is_one_line(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    two = tmp_path / "two.loop.yaml"
    text = find_config("tank_linear.loop.yaml").read_text(encoding="utf-8")
    two.write_text(text + "controller: {kind: pi, gain: 1.0, integral_time: 9.0}\n")
    out = tmp_path / "no.csv"
    given = [word.format(two=two) for word in arguments]
    assert main(["simulate", *given, "--out", str(out)]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1
    assert not out.exists()
