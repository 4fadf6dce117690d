"""What a stem that moves between two samples does to the output."""

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import cont2discrete, lfilter

from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.simulation.between import left_open
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Backlash, FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record

FINE = 50  # steps of the plant in a sample
PLANT = 1.0, np.polymul([2.5, 1.0], np.polymul([4.0, 1.0], [6.0, 1.0]))


def answer(stem: FloatArray, step: float) -> FloatArray:
    """Return the output of the plant behind a held stem, by scipy."""
    b, a, _ = cont2discrete(PLANT, step)
    return np.asarray(lfilter(b[0], a, stem))


def model() -> LoopModel:
    b, a, _ = cont2discrete(PLANT, 1.0)
    process = {"kind": "arx", "outputs": [{"name": "PV", "a": a[1:].tolist(), "delay": {"V": 0}}]}
    process["outputs"][0]["b"] = {"V": b[0][1:].tolist()}  # type: ignore[index]
    return LoopModel.from_mapping(
        {"loop": "plant", "sample_time": 1.0, "valves": [{"name": "V"}], "process": process},
        "plant",
    )


@settings(deadline=None, max_examples=20)
@given(st.integers(1, FINE - 1), st.integers(0, 1000))
def test_a_stem_that_moves_late_within_a_sample_is_covered(late: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    op = np.repeat(random.uniform(-10.0, 10.0, 40), 12)
    sticky = model().with_effect("valve:V", Backlash(2.0))
    record = Record("r", 1.0, ("V",), ("PV",), op[:, None], np.zeros((len(op), 1)))
    runs = dataclasses.replace(open_gate(model(), [record])[0], between=(True,))
    run = FreeRun(sticky, runs)
    fine = np.repeat(run.stems[:, 0] - run.stems[0, 0], FINE)
    moved = np.concatenate([np.zeros(late), fine[:-late]])
    lacks = answer(moved, 1.0 / FINE)[::FINE] - answer(fine, 1.0 / FINE)[::FINE]
    columns = np.hstack(left_open(run, 0))

    def left(by: FloatArray) -> float:
        return float(np.std(lacks - by @ np.linalg.lstsq(by, lacks, rcond=None)[0]) / np.std(lacks))

    assert left(columns) < 0.003  # a straight line between two samples leaves 0.02
