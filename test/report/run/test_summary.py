import dataclasses
import json
import math
from pathlib import Path

import pytest

from stiction_ros.records.run.log import RunLog
from stiction_ros.report.page import write_page
from stiction_ros.report.run.scoring import NOISE_SHARE
from stiction_ros.report.run.story import summary, tell


def test_the_keys_that_the_contract_names(log: RunLog) -> None:
    found = summary(tell(log, name="made_up"))
    assert found["scenario"] == "made_up"
    assert (found["seed"], found["samples"], found["seconds"]) == (7, 1200, 10.0)
    assert found["samples_per_second"] == pytest.approx(120.0)
    assert found["swap_time"] == 500.0
    assert found["delay"] == {"PV1": {"V1": 3}}
    assert found["messages"] == {
        "/clock": {"published": None, "recorded": 12},
        "/pv": {"published": 1200, "recorded": 1200},
    }
    assert found["phases"].keys() == {"before", "after"}
    before, after = found["phases"]["before"]["PV1"], found["phases"]["after"]["PV1"]
    assert before.keys() == {"amplitude", "offset", "iae_per_hour"}
    work = found["valve_work"]
    assert work.keys() == {"before", "after"}
    assert work["before"]["V1"].keys() == {"travel", "moves", "reversals"}
    assert work["before"]["V1"]["moves"] == pytest.approx(2 * 3600 / 40, rel=0.06)
    assert work["before"]["V1"]["travel"] == pytest.approx(6.0 * 2 * 3600 / 40, rel=0.06)
    assert found["largest_op_step"]["before"]["V1"] == pytest.approx(5 * 2 * math.pi / 40, rel=0.01)
    assert before["amplitude"] == pytest.approx(1.0, rel=0.03)
    assert after["amplitude"] == pytest.approx(0.05, abs=0.02)
    assert before["iae_per_hour"] == pytest.approx(0.637 - NOISE_SHARE * 0.05, abs=0.01)
    assert found["status"] == "ok"


def test_wall_time_is_that_of_who_ran_it(log: RunLog) -> None:
    assert summary(tell(log, name="made_up"), 7.5)["seconds"] == 7.5


def test_the_fit_before_the_swap_and_the_latest(log: RunLog) -> None:
    found = summary(tell(log))
    assert found["valves"][0]["f_s"] == 5.1
    assert found["valves_latest"][0]["f_s"] == 4.9


def test_the_wall_time_that_is_given_counts(log: RunLog) -> None:
    assert summary(tell(log), seconds=4.0)["samples_per_second"] == 300.0


def test_numbers_that_json_does_not_have_become_null(log: RunLog, tmp_path: Path) -> None:
    log = dataclasses.replace(log, wall_seconds=float("nan"), fits=())
    found = summary(tell(log))
    write_page(tmp_path, "", found)
    read = json.loads((tmp_path / "summary.json").read_text(), parse_constant=pytest.fail)
    assert read["seconds"] is None
    assert read["samples_per_second"] is None
    assert read["valves"] == []


def test_without_a_swap_the_status_says_so(healthy: RunLog) -> None:
    found = summary(tell(healthy))
    assert found["status"] == "no_swap"
    assert found["swap_time"] is None
    assert found["phases"].keys() == {"before"}


def test_times_from_pv_to_op_are_null_in_lockstep(log: RunLog) -> None:
    assert summary(tell(log))["pv_to_op_ms"] is None
    times = {"p50": 1.0, "p99": 2.0, "p999": 3.0, "max": 4.0}
    log = dataclasses.replace(log, pv_to_op_ms=times)
    assert summary(tell(log))["pv_to_op_ms"] == times
