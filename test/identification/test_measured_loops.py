"""Measured loops of the International Stiction Data Base, with default options."""

import csv
import pathlib

import numpy as np
import pytest

from stiction_ros.identification import VerdictKind, identify
from stiction_ros.records.record import Record

DATA = pathlib.Path(__file__).resolve().parents[3] / "shared" / "data" / "isdb"


def load(name: str) -> Record:
    path = DATA / f"{name}.csv"
    if not path.exists():
        pytest.skip(f"measured loop {name} is not at ../shared/data/isdb")
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    columns = {key: np.array([float(row[key]) for row in rows]) for key in ("t", "OP", "PV")}
    step = float(np.median(np.diff(columns["t"])))
    return Record(name, step, ("V1",), ("PV1",), columns["OP"][:, None], columns["PV"][:, None])


@pytest.mark.trial
@pytest.mark.parametrize("name", ["CHEM1", "CHEM10", "CHEM24", "PAP2"])
def test_sticky_loop(name: str) -> None:
    """Contributors say *sticky* of a jump and of a deadband alike."""
    assert identify(load(name)).valves[0].verdict.has_friction


@pytest.mark.trial
@pytest.mark.parametrize("name", ["CHEM13", "PAP9"])
def test_loop_that_oscillates_for_another_reason(name: str) -> None:
    assert not identify(load(name)).valves[0].verdict.has_friction


def test_loop_of_a_valve_with_a_dead_zone() -> None:
    assert identify(load("PAP4")).valves[0].verdict is not VerdictKind.STICKY
