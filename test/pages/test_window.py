"""The window of four cycles, from answers that are made up."""

import dataclasses

import numpy as np
import pytest
from made import identification, record

from stiction_ros.identification.result import CauseKind, FitStatus, Identification
from stiction_ros.pages.signals import CYCLES, UNCYCLED, Window
from stiction_ros.records.record import Quality

PERIOD, SAMPLES = 60.0, 1200


def answer(period: float | None = PERIOD, kind: CauseKind = CauseKind.VALVE) -> Identification:
    found = identification(record(SAMPLES))
    cause = found.outputs[0].cause
    assert cause is not None
    output = dataclasses.replace(
        found.outputs[0], cause=dataclasses.replace(cause, kind=kind, period=period)
    )
    return dataclasses.replace(found, outputs=(output,))


def test_four_cycles_of_the_middle_are_shown() -> None:
    window = Window.of(record(SAMPLES), answer())
    assert (window.valve, window.output, window.period) == (0, 0, PERIOD)
    assert window.last - window.first - 1 == CYCLES * PERIOD
    assert window.first + window.last == pytest.approx(SAMPLES, abs=1)
    assert window.named(1.0) == "about 4 cycles of 60 s on average"


def test_the_widest_band_and_the_output_that_cycles_with_it_are_shown() -> None:
    one, found = record(SAMPLES), answer()
    two = dataclasses.replace(
        one,
        valves=("V1", "V2"),
        outputs=("PV1", "PV2"),
        op=one.op.repeat(2, axis=1),
        pv=one.pv.repeat(2, axis=1),
        sp=None,
    )
    wider = dataclasses.replace(found.valves[0], name="V2", band_share=0.9)
    calm = dataclasses.replace(found.outputs[0], cause=None)
    other = dataclasses.replace(found.outputs[0], name="PV2")
    both = dataclasses.replace(found, valves=(found.valves[0], wider), outputs=(calm, other))
    window = Window.of(two, both)
    assert (window.valve, window.output) == (1, 1)


def test_without_a_cycle_some_samples_are_shown() -> None:
    window = Window.of(record(SAMPLES), answer(None))
    assert window.last - window.first == UNCYCLED
    assert "without a regular cycle" in window.named(1.0)
    calm = answer(kind=CauseKind.NONE)
    assert Window.of(record(SAMPLES), calm).period is None
    failed = dataclasses.replace(answer(), valves=(), outputs=(), status=FitStatus.NO_MODEL)
    assert Window.of(record(SAMPLES), failed).period is None


def test_a_window_stays_within_a_good_part() -> None:
    mask = np.zeros(SAMPLES, dtype=np.uint8)
    mask[300:900] = Quality.BAD
    window = Window.of(dataclasses.replace(record(SAMPLES), mask=mask), answer())
    assert 0 <= window.first < window.last <= 300
    slow = Window.of(record(SAMPLES), answer(900.0))
    assert (slow.first, slow.last) == (0, SAMPLES)
    assert slow.named(1.0) == "about 1.3 cycles of 900 s on average"
