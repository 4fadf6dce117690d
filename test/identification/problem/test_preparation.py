"""A long record is searched in part and concluded as a whole."""

import dataclasses

import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.identification import IdentificationOptions, VerdictKind, identify
from stiction_ros.identification.problem import preparation
from stiction_ros.identification.problem.preparation import liveliest_part, prepare


def test_short_record_is_taken_whole() -> None:
    data = prepare(loops.example1(0, samples=500), IdentificationOptions())
    assert liveliest_part(data) is data


def test_part_is_where_op_moves_most(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preparation, "PART", 300)
    record = loops.example1(0, samples=1200)
    quiet = record.op.copy()
    quiet[:, 0] *= np.where(np.arange(1200) < 800, 0.01, 1.0)
    data = prepare(dataclasses.replace(record, op=quiet), IdentificationOptions())
    part = liveliest_part(data)
    assert part.u.shape == (1, 300)
    begin = int(np.argmin([np.abs(data.u[0, i : i + 300] - part.u[0]).max() for i in range(901)]))
    assert begin >= 700
    assert (part.y == data.y[:, begin : begin + 300]).all()


@pytest.mark.trial
def test_conclusion_uses_all_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preparation, "PART", 1300)
    options = IdentificationOptions(output_order=3, input_order=3)
    record = loops.example1(1, "equation")
    found = identify(record, options)
    valve = found.valves[0]
    assert found.stem.shape == (2500, 1)
    assert valve.verdict is VerdictKind.STICKY
    assert valve.static_friction == pytest.approx(5.0, abs=0.1)
    assert valve.dynamic_friction == pytest.approx(2.0, abs=0.1)
    assert record.stem is not None
    assert np.sqrt(np.mean((found.stem - record.stem) ** 2)) < 0.3
