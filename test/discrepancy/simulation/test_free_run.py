"""A free run of the right model leaves no gap but what is projected out."""

import dataclasses

import numpy as np
import pytest
from gap_loops import loop, record

from stiction_ros.config_files import find_config
from stiction_ros.discrepancy.simulation.free_run import FEWEST, FreeRun, join_records
from stiction_ros.effects import (
    ExtraDelay,
    ExtraPole,
    HeStiction,
    Lag,
    Leak,
    ProcessGain,
    StepDisturbance,
)
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel, random_binary, simulate_open_loop
from stiction_ros.records import Record


def noise_free(model: LoopModel) -> LoopModel:
    document = model.to_mapping()
    for output in document["process"].get("outputs", []):
        output["noise"] = {"std": 0.0}
    return LoopModel.from_mapping(document)


def moved(model: LoopModel, samples: int = 300) -> Record:
    op = random_binary(np.random.default_rng(5), samples, len(model.valves))
    op[:20] = 50.0  # at rest, as the free run takes every valve to be
    return simulate_open_loop(model, op, 0).record


def left(model: LoopModel, recorded: Record) -> float:
    """Return the gap that the free columns cannot take up, as a share of the moves of PV."""
    run = FreeRun(model, join_records(model, [recorded]))
    worst = 0.0
    for i in range(run.gap.shape[1]):
        rows = slice(run.responses.skip, None)
        columns, gap = run.free[i][rows], run.gap[rows, i]
        gap = gap - columns @ np.linalg.lstsq(columns, gap, rcond=None)[0]
        worst = max(worst, float(np.abs(gap).max() / np.ptp(recorded.pv[:, i])))
    return worst


@pytest.mark.parametrize("name", ["example1", "tank", "tank_linear"])
def test_every_kind_of_process_is_run_as_the_plant_does(name: str) -> None:
    model = noise_free(LoopModel.load(find_config(f"{name}.loop.yaml")))
    assert left(model, moved(model)) < 1e-6


@pytest.mark.parametrize(
    ("place", "effect"),
    [
        ("valve:V1", HeStiction(6.0, 2.0)),
        ("valve:V1", Lag(5.0)),
        ("process:PV1", ExtraPole(7.0)),
        ("process:PV1", ExtraDelay(3.0)),
        ("process:PV1", ProcessGain(1.7)),
        ("process:PV1", Leak(0.03)),
        ("disturbance:PV1", StepDisturbance(120.0, 2.0)),
    ],
)
def test_effects_of_the_model_are_in_its_free_run(place: str, effect: object) -> None:
    model = noise_free(loop()).with_effect(place, effect)  # type: ignore[arg-type]
    assert left(model, moved(model)) < 1e-6


def test_the_lack_of_an_effect_leaves_a_gap() -> None:
    model = noise_free(loop())
    assert left(model, moved(model.with_effect("valve:V1", HeStiction(6.0, 2.0)))) > 0.01


def test_two_records_have_starts_of_their_own() -> None:
    model = noise_free(loop())
    first = moved(model)
    second = dataclasses.replace(first, pv=first.pv + 3.0)
    run = FreeRun(model, join_records(model, [first, second]))
    rows = np.ones(len(run.runs), dtype=bool)
    rows[: run.responses.skip] = rows[len(first) : len(first) + run.responses.skip] = False
    columns, gap = run.free[0][rows], run.gap[rows, 0]
    gap = gap - columns @ np.linalg.lstsq(columns, gap, rcond=None)[0]
    assert np.abs(gap).max() < 1e-6


def test_fitted_and_held_out_rows_do_not_meet() -> None:
    run = FreeRun(loop(), join_records(loop(), [record(loop())]))
    blocks = run.blocks(0)
    assert not (blocks.train & blocks.held).any()


def test_another_sample_time_is_refused() -> None:
    other = dataclasses.replace(record(loop()), sample_time=2.0)
    with pytest.raises(InputError, match="sampled every 2 s"):
        join_records(loop(), [other])


def test_a_record_without_the_valve_is_refused() -> None:
    other = dataclasses.replace(record(loop()), valves=("FV",))
    with pytest.raises(InputError, match="no valve 'V1'"):
        join_records(loop(), [other])


def test_an_unstable_model_is_refused() -> None:
    document = loop().to_mapping()
    document["process"]["outputs"][0]["a"] = [-3.0, 2.0]
    model = LoopModel.from_mapping(document)
    with np.errstate(all="ignore"), pytest.raises(InputError, match="without bound"):
        FreeRun(model, join_records(model, [record(loop(), samples=3000)]))


def test_a_record_of_a_few_samples_is_refused_in_one_sentence() -> None:
    short = record(loop(), samples=FEWEST - 1)
    with pytest.raises(InputError, match=f"{FEWEST - 1} samples are too few, {FEWEST} are needed"):
        join_records(loop(), [short])
    join_records(loop(), [short, record(loop(), samples=FEWEST)])
