"""Measured loops without a model, with default options but for the bootstraps."""

import csv
import dataclasses
import math
import os
import pathlib

import numpy as np
import pytest

from stiction_ros.discrepancy import Discrepancy, GapOptions, GapVerdict, find_discrepancy
from stiction_ros.discrepancy.process.first_model import first_model
from stiction_ros.effects import FloatArray
from stiction_ros.records.record import Record

DATA = pathlib.Path(__file__).resolve().parents[3] / "shared" / "data"
FRICTION = {"stiction", "backlash"}
WORDS = {"time", "MODE"}

pytestmark = [pytest.mark.trial, pytest.mark.filterwarnings("error::RuntimeWarning")]


def columns(path: pathlib.Path) -> dict[str, FloatArray]:
    if not path.exists():
        pytest.skip(f"measured loop {path.stem} is not at ../shared/data/{path.parent.name}")
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0] if key not in WORDS}


def compared(
    name: str, op: FloatArray, pv: FloatArray, step: float, stem: FloatArray | None = None
) -> Discrepancy:
    record = Record(name, step, ("V1",), ("PV1",), op[:, None], pv[:, None])
    if stem is not None:
        record = dataclasses.replace(record, stem=stem[:, None])
    options = GapOptions(quick=True, process_fitted=True)
    return find_discrepancy(first_model([record]), [record], options)


def effects_are_told(answer: Discrepancy) -> None:
    """Check what holds for every answer about a measured loop."""
    record = answer.runs.records[0]
    lasts = float(answer.runs.time.max())
    for found in answer.effects:
        kind, _, tag = found.place.partition(":")
        signal = record.op if kind in ("valve", "load") else record.pv
        width = 10.0 * float(np.ptp(signal))
        for key, (low, high) in found.intervals.items():
            assert low <= found.parameters[key] <= high
            if found.units[key] == "s" and key not in ("period", "tau"):
                assert high - low <= lasts, (tag, key)
            elif key in ("size", "amplitude", "band", "f_s", "f_d"):
                assert high - low <= width, (tag, key)
        if not math.isnan(found.closed):
            assert found.closed >= 0.2
    named = {(e.place, e.effect) for e in answer.effects} | set(answer.alternatives)
    named |= {name for e in answer.effects for name in e.alternatives}
    assert not named & {(t.place, t.effect) for t in answer.untestable}
    frictions = [e.place for e in answer.effects if e.effect in FRICTION]
    assert len(frictions) == len(set(frictions))


def plant(name: str) -> Discrepancy:
    signals = columns(DATA / "plant" / f"{name}.csv")
    return compared(name, signals["OP"], signals["PV"], 10.0)


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
    effects_are_told(answer)


@pytest.mark.parametrize("name", ["CHEM13", "PAP9"])
def test_no_friction_where_there_is_another_reason(name: str) -> None:
    answer = isdb(name)
    assert not FRICTION & {effect.effect for effect in answer.effects}
    effects_are_told(answer)


@pytest.mark.parametrize("pv", ["F_t_h", "LEVEL_pct"])
def test_nothing_moves_a_stem_away_from_the_measured_one(pv: str) -> None:
    signals = columns(DATA / "damadics" / "lublin_actuator3_2001-10-11_1h.csv")
    answer = compared("damadics", signals["CV_pct"], signals[pv], 1.0)
    before = np.sum((answer.base_before.run.stems[:, 0] - signals["X_pct"]) ** 2)
    after = np.sum((answer.base_after.run.stems[:, 0] - signals["X_pct"]) ** 2)
    assert after <= before


@pytest.mark.parametrize("name", ["PAP2", "PAP4"])
def test_figures_and_words_of_control_loops_hold_together(name: str) -> None:
    effects_are_told(isdb(name))


@pytest.mark.parametrize(
    "name", ["2111LIC31102B_0825_0007", "2411FIC20102_0609_0957", "2411FIC20102_0823_1527"]
)
def test_figures_and_words_of_plant_records_hold_together(name: str) -> None:
    effects_are_told(plant(name))


def test_figures_and_words_of_all_records_hold_together() -> None:
    if os.environ.get("STICTION_ALL_TRIALS") != "1":
        pytest.skip("two minutes: STICTION_ALL_TRIALS=1")
    for folder, answered in (("isdb", isdb), ("plant", plant)):
        for path in sorted((DATA / folder).glob("*.csv")):
            if path.stem != "index":
                effects_are_told(answered(path.stem))


def test_a_measured_stem_is_spoken_of_first() -> None:
    signals = columns(DATA / "damadics" / "lublin_actuator3_2001-10-11_1h.csv")
    answer = compared("damadics", signals["CV_pct"], signals["F_t_h"], 1.0, signals["X_pct"])
    effects_are_told(answer)
    assert answer.where[0].startswith("the stem of V1 is recorded")
