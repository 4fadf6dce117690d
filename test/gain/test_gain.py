from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from stiction_ros.errors import InputError
from stiction_ros.gain.draws import drawn_frictions
from stiction_ros.gain.embedding import PROCESSES, EmbeddingDesign, embedded, pair_of
from stiction_ros.gain.gain import AGREED, Gain, What, embedding_part, gain_of
from stiction_ros.gain.model_gain import gain_of_model
from stiction_ros.gain.recorded_loop import RecordedLoop
from stiction_ros.gain.stems import stems_of
from stiction_ros.identification import Identification, IdentificationOptions, VerdictKind, identify
from stiction_ros.loop import LoopModel
from stiction_ros.loop.closed_loop import PiController, simulate_closed_loop
from stiction_ros.loop.set_points import SetPoints
from stiction_ros.records.record import Record

MODEL = {
    "loop": "FIC1",
    "sample_time": 1.0,
    "valves": [
        {
            "name": "V1",
            "limits": [0.0, 100.0],
            "effects": [{"effect": "stiction", "law": "he", "f_s": 4.0, "f_d": 1.5}],
        }
    ],
    "process": {
        "kind": "arx",
        "outputs": [
            {
                "name": "PV1",
                "a": [-0.8],
                "b": {"V1": [0.2]},
                "delay": {"V1": 2},
                "noise": {"std": 0.05, "enters": "measurement"},
            }
        ],
    },
    "operating_point": {"op": {"V1": 50.0}, "pv": {"PV1": 50.0}},
    "controller": {"kind": "pi", "gain": 0.5, "integral_time": 5.0},
}


@pytest.fixture(scope="module")
def model() -> LoopModel:
    return LoopModel.from_mapping(MODEL)


@pytest.fixture(scope="module")
def record(model: LoopModel) -> Record:
    assert model.controller is not None
    control = PiController(model.controller, 1.0, 50.0, (0.0, 100.0))
    moves = SetPoints(("PV1",), np.array([0.0, 20.0]), np.array([[50.0], [53.0]]))
    run = simulate_closed_loop(model, control, moves, 1500, 3)
    return dataclasses.replace(run.record, stem=None)


@pytest.fixture(scope="module")
def found(record: Record) -> Identification:
    return identify(record, IdentificationOptions("exact"))


@pytest.fixture(scope="module")
def gain(record: Record, found: Identification) -> Gain:
    return gain_of(record, found)


def test_service_is_predicted_as_the_loop_without_friction_does(
    gain: Gain, model: LoopModel
) -> None:
    assert model.controller is not None
    control = PiController(model.controller, 1.0, 50.0, (0.0, 100.0))
    moves = SetPoints(("PV1",), np.array([0.0, 20.0]), np.array([[50.0], [53.0]]))
    run = simulate_closed_loop(model.with_ideal_valves(), control, moves, 1500, 3)
    assert run.record.sp is not None
    true = float(np.abs(run.record.pv - run.record.sp).mean())
    service = gain.option(What.SERVICE).measures
    assert service is not None
    assert service.iae_per_hour == pytest.approx(true, rel=0.35)
    assert service.iae_per_hour < 0.5 * gain.now.iae_per_hour
    assert gain.now.amplitude is not None
    assert service.amplitude is not None
    assert service.amplitude < 0.2 * gain.now.amplitude


def test_leaving_the_loop_is_now(gain: Gain) -> None:
    left = gain.option(What.LEAVE).measures
    assert left is not None
    for key, value in left.to_json().items():
        assert value == pytest.approx(getattr(gain.now, key))


def test_leaving_a_loop_that_is_not_repeated_is_now_too(
    record: Record, found: Identification, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stiction_ros.gain.gain.REPEATS", -1.0)
    unlike = gain_of(record, found)
    assert unlike.option(What.LEAVE).measures == unlike.now
    assert unlike.option(What.SERVICE).measures is None


def test_every_option_stands_in_the_json_with_its_interval(gain: Gain) -> None:
    document = gain.to_json()
    assert [option["what"] for option in document["options"]] == [
        "service",
        "embedding",
        "retune",
        "leave",
    ]
    for option in document["options"]:
        low, high = option["interval"]["iae_per_hour"]
        assert low <= high
        if option["what"] != "embedding":
            assert option["iae_per_hour"] is not None
    assert document["options"][1]["settings"]["embedding_move_weights"] > 0.0


def test_the_embedding_takes_over_and_does_not_rest_off_its_place(
    record: Record, found: Identification, gain: Gain
) -> None:
    """Begun cold, its slip check believed in a larger friction and the stem never moved again."""
    loop = RecordedLoop.of(record, found)
    part = embedding_part(loop)
    now = part.now().iae_per_hour
    runs = embedded(part, EmbeddingDesign.of(loop), np.array([pair_of(loop.estimate)]))
    assert len(runs) == len(PROCESSES)
    for run in runs:
        assert run is not None
        assert run.iae_per_hour < 0.6 * now
    interval = gain.option(What.EMBEDDING).interval["iae_per_hour"]
    assert interval[1] < 0.6 * gain.now.iae_per_hour


def test_what_drawn_loops_do_not_agree_on_has_no_figures(gain: Gain) -> None:
    option = gain.option(What.EMBEDDING)
    low, high = option.interval["iae_per_hour"]
    wide = high - low > AGREED * (high + low)
    assert (option.measures is None) == ("do not agree" in option.note)
    if wide:
        assert option.measures is None


def test_another_process_repeats_the_record_with_its_own_load(
    record: Record, found: Identification
) -> None:
    loop = RecordedLoop.of(record, found)
    other = loop.with_process(1.25, 1.5)
    assert other.process.delay[0, 0] == loop.process.delay[0, 0] + 1
    assert np.allclose(other.process.b, 1.25 * loop.process.b)
    rows = slice(*other.rows)
    repeated = other.simulated[rows] + other.load[other.past :]
    assert np.allclose(repeated, other.loop.pv[rows])
    assert other.with_process(1.0, 0.5).process.delay[0, 0] == loop.process.delay[0, 0]


def test_backlash_is_planned_without_a_least_jump(found: Identification) -> None:
    valve = found.valves[0]
    assert pair_of(valve) == (valve.static_friction, valve.dynamic_friction)
    static, dynamic = pair_of(dataclasses.replace(valve, jump=0.0))
    assert static == dynamic == 0.5 * (valve.static_friction + valve.dynamic_friction)


def test_the_same_record_gives_the_same_answer(
    gain: Gain, record: Record, found: Identification
) -> None:
    assert gain_of(record, found).to_json() == gain.to_json()


def test_a_healthy_valve_gains_nothing_by_service(record: Record, found: Identification) -> None:
    valves = tuple(
        dataclasses.replace(
            valve, verdict=VerdictKind.HEALTHY, static_friction=0.0, dynamic_friction=0.0
        )
        for valve in found.valves
    )
    stem = record.op
    gain = gain_of(record, dataclasses.replace(found, valves=valves, stem=stem))
    service = gain.option(What.SERVICE).measures
    assert service is None or service == gain.now
    assert gain.option(What.EMBEDDING).measures is None


def test_a_record_without_a_controller_is_refused(record: Record, found: Identification) -> None:
    random = np.random.default_rng(1)
    op = 50.0 + 10.0 * np.cumsum(random.standard_normal((len(record), 1)), axis=0)
    with pytest.raises(InputError, match="controller"):
        gain_of(dataclasses.replace(record, op=op), dataclasses.replace(found, stem=op))


def test_a_model_is_simulated_under_its_own_controller(model: LoopModel) -> None:
    gain = gain_of_model(model, samples=600)
    service, embedding = (gain.option(what).measures for what in (What.SERVICE, What.EMBEDDING))
    assert service is not None
    assert embedding is not None
    assert service.iae_per_hour < 0.6 * gain.now.iae_per_hour
    assert embedding.iae_per_hour < 0.8 * gain.now.iae_per_hour
    assert gain.option(What.LEAVE).measures == gain.now


def test_a_model_without_a_controller_is_refused() -> None:
    bare = {key: value for key, value in MODEL.items() if key != "controller"}
    with pytest.raises(InputError, match=r"no controller.*add controller"):
        gain_of_model(LoopModel.from_mapping(bare))


def test_draws_stay_inside_the_intervals_and_keep_their_order(found: Identification) -> None:
    valve = dataclasses.replace(
        found.valves[0],
        static_friction=3.0,
        static_interval=(2.0, 4.0),
        dynamic_friction=2.5,
        dynamic_interval=(1.0, 3.5),
    )
    pairs = drawn_frictions(valve, 20, np.random.default_rng(0))
    assert tuple(pairs[0]) == (3.0, 2.5)
    assert np.all((pairs[:, 0] >= 2.0) & (pairs[:, 0] <= 4.0))
    assert np.all((pairs[:, 1] >= 1.0) & (pairs[:, 1] <= pairs[:, 0]))


def test_stems_follow_the_law() -> None:
    op = np.array([[0.0, 3.0, 5.0, 4.0, 1.0]])
    stems = stems_of(op, np.array([[4.0, 1.0]]), np.zeros(1))
    assert stems.tolist() == [[0.0, 0.0, 4.0, 4.0, 4.0]]
