"""What a long run is judged by."""

import dataclasses
import math

import pytest

from stiction_ros.cli.main import main
from stiction_studies.commands.soak import parameters
from stiction_studies.faults.soak import Memory, Readings, Soaked

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
