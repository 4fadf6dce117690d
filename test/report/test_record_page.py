"""The sections of words, from answers that are made up."""

import dataclasses

import numpy as np
import pytest

from stiction_ros.identification import VerdictKind
from stiction_ros.identification.result import (
    Cause,
    CauseKind,
    FitStatus,
    Identification,
    OutputModel,
    ValveEstimate,
)
from stiction_ros.records.record import Record
from stiction_ros.report.record_page import lead, work_table

PERIOD, SAMPLES, STEP = 40.0, 1000, 2.0


@pytest.fixture
def record() -> Record:
    """Two valves; OP of the first is a sine, that of the second rests but for ten moves."""
    turn = 2.0 * np.pi * STEP * np.arange(SAMPLES) / PERIOD
    rare = 50.0 + np.repeat([0.0, 1.0] * 5, SAMPLES // 10)
    op = np.column_stack([50.0 + 4.0 * np.sin(turn), rare])
    pv = np.column_stack([10.0 + np.sin(turn - 1.0), 20.0 + np.cos(turn)])
    return Record("loop", STEP, ("V1", "V2"), ("PV1", "PV2"), op, pv)


def valve(name: str, share: float) -> ValveEstimate:
    return ValveEstimate(
        name=name,
        verdict=VerdictKind.STICKY,
        law="he",
        static_friction=3.0,
        static_interval=(2.8, 3.2),
        dynamic_friction=1.0,
        dynamic_interval=(0.9, 1.1),
        jump=2.0,
        stem_start=50.0,
        moves=40,
        evidence={"loop_gone": 0.8},
        band_share=share,
    )


def answer(record: Record, period: float | None = PERIOD) -> Identification:
    cause = Cause(CauseKind.VALVE, period, 3.0, 0.5, "Its friction does it.")
    b = {"V1": (0.1,), "V2": (0.1,)}
    delay = {"V1": 0, "V2": 0}
    models = [
        OutputModel(name, (-0.9,), b, delay, 0.0, 0.1, 90.0, 80.0, made)
        for name, made in (("PV1", None), ("PV2", cause))
    ]
    return Identification(
        FitStatus.OK,
        "",
        "exact",
        len(record),
        STEP,
        0.1,
        (valve("V1", 0.4), valve("V2", 0.1)),
        tuple(models),
        record.op.copy(),
    )


def test_the_work_of_the_valve_is_that_of_an_hour(record: Record) -> None:
    found = answer(record)
    page = work_table(record, found)
    hours = SAMPLES * STEP / 3600.0
    travel = float(np.abs(np.diff(record.op[:, 0])).sum()) / hours
    assert f">{travel:.0f}<" in page
    assert "stem of V2, estimated: moves per hour" in page
    assert f">{9 / hours:.1f}<" in page  # moves of V2
    without = dataclasses.replace(found, stem=np.empty((0, 2)))
    assert "estimated" not in work_table(record, without)


def test_every_valve_is_told_why_and_what_next(record: Record) -> None:
    page = lead(answer(record))
    assert page.count("What to do next:") == 2
    assert "rests until OP has gone back by 4.00 %" in page
    assert "PV2: cause of the oscillation: valve; period 40 s, amplitude 0.5 PV units." in page
    assert "Its friction does it." not in page  # said with its share already
    assert "<code>stiction gain</code>" in page
    calm = answer(record)
    cause = Cause(CauseKind.DISTURBANCE, PERIOD, 3.0, 0.5, "It comes from outside.")
    models = tuple(dataclasses.replace(model, cause=cause) for model in calm.outputs)
    assert lead(dataclasses.replace(calm, outputs=models)).count("It comes from outside.") == 2
