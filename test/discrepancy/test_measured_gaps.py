"""Measured loops without a model, with default options but for the bootstraps."""

from __future__ import annotations

import csv
import pathlib

import numpy as np
import pytest

from stiction_ros.discrepancy import Discrepancy, GapOptions, GapVerdict, find_discrepancy
from stiction_ros.discrepancy.first_model import first_model
from stiction_ros.effects import FloatArray
from stiction_ros.records.record import Record

DATA = pathlib.Path(__file__).resolve().parents[3] / "shared" / "data"
FRICTION = {"stiction", "backlash"}

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


def columns(path: pathlib.Path) -> dict[str, FloatArray]:
    if not path.exists():
        pytest.skip(f"measured loop {path.stem} is not at ../shared/data/{path.parent.name}")
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def compared(name: str, op: FloatArray, pv: FloatArray, step: float) -> Discrepancy:
    record = Record(name, step, ("V1",), ("PV1",), op[:, None], pv[:, None])
    options = GapOptions(quick=True, free_process=True)
    return find_discrepancy(first_model([record]), [record], options)


def isdb(name: str) -> Discrepancy:
    signals = columns(DATA / "isdb" / f"{name}.csv")
    step = float(np.median(np.diff(signals["t"])))
    return compared(name, signals["OP"], signals["PV"], step)


@pytest.mark.parametrize("name", ["CHEM10", "CHEM24"])
def test_friction_is_named_and_the_gap_shrinks(name: str) -> None:
    answer = isdb(name)
    assert answer.verdict is GapVerdict.NAMED
    assert answer.effects[0].effect in FRICTION
    assert answer.closed > 0.5


@pytest.mark.parametrize("name", ["CHEM13", "PAP9"])
def test_no_friction_where_there_is_another_reason(name: str) -> None:
    answer = isdb(name)
    assert not FRICTION & {effect.effect for effect in answer.effects}


@pytest.mark.parametrize("pv", ["F_t_h", "LEVEL_pct"])
def test_nothing_moves_a_stem_away_from_the_measured_one(pv: str) -> None:
    signals = columns(DATA / "damadics" / "lublin_actuator3_2001-10-11_1h.csv")
    answer = compared("damadics", signals["CV_pct"], signals[pv], 1.0)
    before = np.sum((answer.base_before.run.stems[:, 0] - signals["X_pct"]) ** 2)
    after = np.sum((answer.base_after.run.stems[:, 0] - signals["X_pct"]) ** 2)
    assert after <= before
