"""The figures by which a window is held against the baseline."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[1]))
from monitored_loops import loop, record, sticky

from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.monitor.gap_measure import OutputLook, baseline_of, begun_at_stems, look_at
from stiction_ros.records import Record

HEALTHY = record(loop(), 1200)


def look(model: LoopModel, recorded: Record, chance: float = 0.01) -> OutputLook:
    """Compare the second half of a record with its first."""
    half = len(recorded) // 2
    known = baseline_of(model, recorded.part(0, half))
    (found,) = look_at(model, recorded.part(half, len(recorded)), known, chance)
    return found


def with_noise(recorded: Record, factor: float) -> Record:
    """Return the record with other noise, larger by ``factor`` in its second half."""
    random = np.random.default_rng(4)
    clean = record(loop(1e-9), len(recorded)).pv
    size = np.where(np.arange(len(recorded)) < len(recorded) // 2, 0.1, 0.1 * factor)
    op = record(loop(1e-9), len(recorded)).op
    return dataclasses.replace(
        recorded, op=op, pv=clean + size[:, None] * random.standard_normal(clean.shape)
    )


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0, 5.0])
def test_the_growth_is_that_of_the_noise(factor: float) -> None:
    assert look(loop(), with_noise(HEALTHY, factor)).growth == pytest.approx(factor, rel=0.1)


def test_the_gap_of_a_healthy_loop_is_its_noise() -> None:
    found = look(loop(), HEALTHY)
    assert found.gap == pytest.approx(0.1, rel=0.1)
    assert found.baseline == pytest.approx(0.1, rel=0.1)


@given(scale=st.floats(1e-3, 1e3))
@settings(max_examples=10)
def test_the_unit_of_pv_changes_no_ratio(scale: float) -> None:
    document = loop().to_mapping()
    output = document["process"]["outputs"][0]
    output["b"]["V1"] = [scale * b for b in output["b"]["V1"]]
    document["operating_point"]["pv"]["PV1"] = 50.0 * scale
    other = look(
        LoopModel.from_mapping(document), dataclasses.replace(HEALTHY, pv=HEALTHY.pv * scale)
    )
    one = look(loop(), HEALTHY)
    assert other.growth == pytest.approx(one.growth, rel=1e-6)
    assert other.limit == pytest.approx(one.limit, rel=1e-6)
    assert other.gap == pytest.approx(scale * one.gap, rel=1e-6)


def test_a_smaller_chance_gives_a_wider_limit() -> None:
    limits = [look(loop(), HEALTHY, chance).limit for chance in (0.05, 0.01, 1e-3, 1e-6)]
    assert limits == sorted(set(limits))


def test_the_way_back_is_below_the_alarm() -> None:
    found = look(loop(), HEALTHY, 0.001)
    assert 1.0 < found.back < found.limit


def test_a_baseline_in_bursts_is_worth_less() -> None:
    random = np.random.default_rng(2)
    calm = with_noise(HEALTHY, 1.0)
    size = np.where(np.arange(len(calm)) % 300 < 40, 1.0, 0.1)
    bursts = dataclasses.replace(
        calm, pv=record(loop(1e-9), 1200).pv + size[:, None] * random.standard_normal((1200, 1))
    )
    known = [baseline_of(loop(), one)[0] for one in (calm, bursts)]
    assert known[1].freedom < 0.3 * known[0].freedom


@pytest.mark.trial
def test_a_healthy_window_exceeds_the_limit_as_seldom_as_asked() -> None:
    """One window of each of 100 records: 5 are 5 %, 12 are three sigma more."""
    above = sum(
        found.growth > found.limit
        for seed in range(100)
        for found in [look(loop(), record(loop(), 600, seed), 0.05)]
    )
    assert above <= 11


def test_a_window_with_ideal_valves_is_left_as_it_is() -> None:
    found = begun_at_stems(loop(), HEALTHY, 1100)
    assert found.start == 100.0
    assert np.array_equal(found.op, HEALTHY.op[100:])


@pytest.mark.parametrize("seed", range(1, 5))
def test_the_stem_of_a_sticky_valve_is_right_from_the_first_sample(seed: int) -> None:
    model = sticky()
    recorded = record(model, 500, seed)
    stem = model.valves[0].effects[0].simulate(recorded.op[:, 0])
    window = begun_at_stems(model, recorded, 370)
    again = model.valves[0].effects[0].simulate(window.op[:, 0], window.op[0, 0])
    assert np.array_equal(again, stem[130:])
    assert np.array_equal(window.op[1:], recorded.op[131:])


@pytest.mark.parametrize("seed", range(1, 5))
def test_the_gap_of_a_sticky_loop_with_the_right_model_is_its_noise(seed: int) -> None:
    recorded = record(sticky(), 1200, seed)
    known = baseline_of(sticky(), begun_at_stems(sticky(), recorded.part(0, 700), 550))
    window = begun_at_stems(sticky(), recorded, 400)
    (found,) = look_at(sticky(), window, known, 0.01)
    assert found.gap == pytest.approx(0.1, rel=0.15)
    assert found.baseline == pytest.approx(0.1, rel=0.15)


def test_a_model_that_grows_without_bound_is_one_clear_error() -> None:
    document = loop().to_mapping()
    document["process"]["outputs"][0]["a"] = [-3.0]
    with pytest.raises(InputError, match="grows without bound"):
        baseline_of(LoopModel.from_mapping(document), HEALTHY)
