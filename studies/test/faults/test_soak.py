"""What a long run is judged by."""

from __future__ import annotations

import dataclasses
import math
import os

import pytest

from stiction_ros.cli.main import main
from stiction_studies.commands.soak import parameters
from stiction_studies.faults.soak import Memory, Readings, Soaked, StolenWatch, stolen_seconds

GOOD = Soaked(
    86_400,
    300.0,
    {"controller passed_over": 0, "estimator missed_samples": 0},
    {"plant late_op": "3"},
    {"controller": 20_000, "estimator": 2500},
    {"plant": Memory(80e6, 81e6)},
)


def test_a_run_without_growth_and_loss_passes():
    assert GOOD.reasons == []
    assert GOOD.to_dict()["passed"] is True


@pytest.mark.parametrize(
    "spoilt",
    [
        {"memory": {"plant": Memory(80e6, 82e6)}},
        {"memory": {"plant": Memory(80e6, math.nan)}},
        {"memory": {}},
        {"missed": {"estimator missed_samples": 1}},
        {"missed": {}},
        {"samples": 0},
        {"failures": ("controller ended with code 1",)},
    ],
)
def test_growth_loss_or_nothing_seen_fails(spoilt):
    assert dataclasses.replace(GOOD, **spoilt).reasons


def test_memory_is_compared_from_a_tenth_on():
    readings = Readings()
    for k in range(100):
        readings.add(k / 100, "plant", 50_000_000 if k < 10 else 80_000_000 + 1000 * k)
    memory = readings.memory()["plant"]
    assert memory.tenth == 80_012_000
    assert memory.end == 80_097_000


def test_a_run_too_short_to_compare_says_nothing_of_memory():
    readings = Readings()
    for k in range(8):
        readings.add(k / 8, "plant", 80_000_000)
    readings.add(1.0, "plant", None)
    assert readings.memory() == {}


def test_what_is_missed_while_the_host_has_the_processor_is_told():
    watch = StolenWatch(0.01)
    for stolen, missed in ((5.0, 0), (5.0, 1), (5.03, 1), (5.03, 3), (5.03, 3), (5.03, 4)):
        watch.look(stolen, missed)
    found = watch.found
    assert found.seconds == pytest.approx(0.03)
    assert found.largest == pytest.approx(0.03)
    assert (found.looks, found.long) == (5, 1)
    assert (found.missed, found.missed_then) == (4, 2)


def test_in_lockstep_no_taken_time_is_long():
    watch = StolenWatch(0.0)
    for stolen in (5.0, 9.0, 9.0):
        watch.look(stolen, 0)
    assert watch.found.long == 0


def test_taken_time_is_read_where_the_system_tells(tmp_path):
    stat = tmp_path / "stat"
    stat.write_text("cpu  1 2 3 4 5 6 7 250 0 0\ncpu0 1 2 3 4 5 6 7 8 0 0\n")
    assert stolen_seconds(stat) == pytest.approx(250 / os.sysconf("SC_CLK_TCK"))
    stat.write_text("cpu 1 2\n")
    assert stolen_seconds(stat) is None
    assert stolen_seconds(tmp_path / "none") is None


def options(*given: str):
    from stiction_ros.cli.main import parser

    return parser().parse_args(["soak", *given])


def test_pace_speed_and_samples_reach_the_nodes(tmp_path):
    nodes = parameters(
        options("tank", "--samples", "5", "--pace", "realtime", "--speed", "7"), tmp_path
    )
    assert nodes["plant"]["samples"] == 5
    assert nodes["plant"]["pace"] == nodes["controller"]["pace"] == "realtime"
    assert nodes["plant"]["speed"] == 7.0
    assert "speed" not in parameters(options("--hours", "1"), tmp_path)["plant"]


@pytest.mark.parametrize("given", [[], ["--hours", "0"], ["--samples", "-1"], ["--hours", "inf"]])
def test_a_run_without_an_end_is_refused(given, capsys):
    assert main(["soak", *given]) == 2
    assert "stiction:" in capsys.readouterr().err
