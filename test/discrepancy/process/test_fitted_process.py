"""Effects named without a model: the process is identified from the same records."""

import dataclasses

import numpy as np
import pytest
from gap_loops import loop, record, without_set_points

from stiction_ros.discrepancy import Discrepancy, GapOptions, GapVerdict, find_discrepancy
from stiction_ros.discrepancy.process.first_model import first_model, liveliest_parts
from stiction_ros.effects import Behaviour, Characteristic, HeStiction
from stiction_ros.loop import LoopModel, Plant
from stiction_ros.online.controller.live import LiveController
from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.records import Record

QUICK = GapOptions(quick=True, process_fitted=True)

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


def recorded(effect: Behaviour | None, seed: int = 1, samples: int = 700) -> Record:
    model = loop()
    true = model if effect is None else model.with_effect("valve:V1", effect)
    return without_set_points(record(true, seed, samples))


def found(*records: Record) -> Discrepancy:
    return find_discrepancy(first_model(records), records, QUICK)


@pytest.fixture(scope="module")
def sticky() -> Discrepancy:
    return found(recorded(HeStiction(4.0, 1.5)))


def test_stiction_is_named_without_a_model(sticky: Discrepancy) -> None:
    (effect,) = sticky.effects
    assert (sticky.verdict, effect.effect) == (GapVerdict.NAMED, "stiction")
    assert effect.parameters["f_s"] == pytest.approx(4.0, abs=0.15)
    assert effect.parameters["f_d"] == pytest.approx(1.5, abs=0.15)


def test_the_friction_lies_in_its_interval(sticky: Discrepancy) -> None:
    (effect,) = sticky.effects
    for key, true in (("f_s", 4.0), ("f_d", 1.5)):
        low, high = effect.intervals[key]
        assert low <= true <= high
        assert high - low < 1.0


def test_the_gap_closes_where_nothing_was_fitted(sticky: Discrepancy) -> None:
    assert sticky.closed > 0.8
    assert sticky.after[0].one_step_rmse < sticky.before[0].one_step_rmse


def test_the_model_found_runs_as_a_plant(sticky: Discrepancy) -> None:
    model = LoopModel.from_yaml(sticky.model_after.to_yaml())
    plant = Plant(model, 0)
    start = np.array(model.stem_start)
    assert plant.apply(start + 1.0) == pytest.approx(start)  # within its friction


@pytest.mark.parametrize("mode", ["unaware", "embedding"])
def test_the_model_found_makes_a_controller(sticky: Discrepancy, mode: str) -> None:
    model = LoopModel.from_yaml(sticky.model_after.to_yaml())
    live = LiveController(LiveControllerSettings(mode=mode), model)
    assert live.mode == mode


@pytest.mark.trial
def test_a_sound_loop_lacks_nothing() -> None:
    answer = found(recorded(None, seed=4))
    assert answer.effects == ()


@pytest.mark.trial
def test_a_curve_may_be_the_process_s() -> None:
    answer = found(recorded(Characteristic(4.0), samples=900))
    assert (answer.verdict, answer.effects) == (GapVerdict.AMBIGUOUS, ())
    assert {("valve:V1", "characteristic"), ("process:PV1", "gain")} <= set(answer.alternatives)


@pytest.mark.trial
@pytest.mark.parametrize(("share", "told"), [(1.0, True), (0.2, False)])
def test_a_recorded_stem_tells_whose_the_curve_is(share: float, told: bool) -> None:
    data = record(loop().with_effect("valve:V1", Characteristic(4.0)), samples=700, stem=True)
    assert data.stem is not None
    stem = data.op + share * (data.stem - data.op)
    answer = found(dataclasses.replace(without_set_points(data), stem=stem))
    assert ("characteristic" in {effect.effect for effect in answer.effects}) == told


@pytest.mark.trial
def test_several_records_are_fitted_together() -> None:
    effect = HeStiction(4.0, 1.5)
    answer = found(recorded(effect, 1, 450), recorded(effect, 2, 450))
    assert [e.effect for e in answer.effects] == ["stiction"]
    assert answer.effects[0].parameters["f_s"] == pytest.approx(4.0, abs=0.3)
    assert answer.closed > 0.5


def test_a_long_record_keeps_its_liveliest_part() -> None:
    data = recorded(None, samples=800)
    op = data.op.copy()
    op[:500] = op[0]
    (part,) = liveliest_parts([dataclasses.replace(data, op=op)], most=300)
    assert np.array_equal(part.op, op[500:])
    assert "samples 500 to 799" in part.notes[-1]


def test_short_records_stay_whole() -> None:
    data = recorded(None)
    assert liveliest_parts([data]) == (data,)
