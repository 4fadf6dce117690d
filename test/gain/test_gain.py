import dataclasses

import numpy as np
import pytest

from stiction_ros.effects import Stiction, from_mapping
from stiction_ros.errors import InputError
from stiction_ros.gain.draws import DRAWS, Draws, drawn_frictions, possible_frictions, resampled
from stiction_ros.gain.embedding import RUNS, EmbeddingDesign, embedded, pair_of
from stiction_ros.gain.gain import Gain, Option, What, gain_of
from stiction_ros.gain.measures import Measures
from stiction_ros.gain.model_gain import gain_of_model
from stiction_ros.gain.recorded_loop import RecordedLoop
from stiction_ros.gain.retuning import UNCHANGED, Tuning, most_helpful
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
def loop(record: Record, found: Identification) -> RecordedLoop:
    return RecordedLoop.of(record, found)


@pytest.fixture(scope="module")
def draws(loop: RecordedLoop) -> Draws:
    return drawn(loop)


def drawn(loop: RecordedLoop) -> Draws:
    return loop.drawn(np.random.default_rng(5))


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
    for key, value in vars(left).items():
        assert value == pytest.approx(getattr(gain.now, key))


def test_leaving_a_loop_that_is_not_repeated_is_now_too(
    record: Record, found: Identification, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stiction_ros.gain.gain.REPEATS", -1.0)
    unlike = gain_of(record, found)
    assert unlike.option(What.LEAVE).measures == unlike.now
    assert unlike.option(What.SERVICE).measures is None


def test_every_option_stands_in_the_json_with_its_interval(gain: Gain) -> None:
    document = gain.to_dict()
    assert [option["what"] for option in document["options"]] == [
        "service",
        "embedding",
        "retune",
        "leave",
    ]
    for option in document["options"]:
        low, high = option["interval"]["iae_per_hour"]
        assert low <= high
        agreed = "do not agree" not in option["note"]
        assert (option["iae_per_hour"] is not None) == agreed
    assert document["options"][0]["iae_per_hour"] is not None
    assert document["options"][1]["settings"]["embedding_move_weights"] > 0.0


@pytest.mark.trial
def test_the_embedding_takes_over_and_does_not_rest_off_its_place(
    loop: RecordedLoop, draws: Draws, gain: Gain
) -> None:
    """Begun cold, its slip check believed in a larger friction and the stem never moved again."""
    part = loop.embedding_part()
    now = part.now().iae_per_hour
    runs = embedded(part, EmbeddingDesign.of(loop), draws)
    assert len(runs) == RUNS
    for run in runs:
        assert run is not None
        assert run.iae_per_hour < 0.6 * now
    interval = gain.option(What.EMBEDDING).interval["iae_per_hour"]
    assert interval[1] < 0.6 * gain.now.iae_per_hour


@pytest.mark.trial
@pytest.mark.parametrize("what", [What.SERVICE, What.EMBEDDING, What.RETUNE])
def test_what_drawn_loops_do_not_agree_on_has_no_figures(
    record: Record, found: Identification, monkeypatch: pytest.MonkeyPatch, what: What
) -> None:
    monkeypatch.setattr("stiction_ros.gain.gain.AGREED", 0.0)
    monkeypatch.setattr("stiction_ros.gain.gain.AGREED_NOW", 0.0)
    option = gain_of(record, found).option(what)
    low, high = option.interval["iae_per_hour"]
    assert low < high
    assert option.measures is None
    assert "do not agree" in option.note


@pytest.mark.parametrize(
    ("said", "interval", "given"),
    [
        (0.85, (0.70, 0.99), True),
        (0.85, (0.70, 1.00), False),  # in some it becomes no better
        (0.95, (0.80, 1.00), True),  # nothing is promised
        (0.80, (0.60, 1.00), False),  # a third more than the least, though a quarter of itself
        (0.74, (0.73, 1.00), False),
        (0.06, (0.02, 0.09), True),  # what is small beside now
    ],
)
def test_a_figure_is_given_where_it_would_hold_in_each_drawn_loop(
    said: float, interval: tuple[float, float], *, given: bool
) -> None:
    now = Measures(None, 1.0, 0.0, 0.0, 0.0)
    measures = dataclasses.replace(now, iae_per_hour=said)
    option = Option(What.SERVICE, measures, {"iae_per_hour": interval}, "")
    assert (option.where_agreed(now).measures is not None) == given


def test_drawn_loops_repeat_the_record(loop: RecordedLoop, draws: Draws) -> None:
    now = loop.now()
    for run in loop.run(draws)[:3]:
        assert run is not None
        assert run.iae_per_hour == pytest.approx(now.iae_per_hour, rel=0.05)


def test_drawn_processes_leave_what_each_does_not_explain(loop: RecordedLoop, draws: Draws) -> None:
    """Equation (9) of a draw, with its stems and what comes from outside, gives PV to the bit."""
    a, b, delay, outside = draws.equations
    pv = loop.loop.pv[loop.begin : loop.rows[1], 0]
    row, r = 400, 7
    value = outside[r, 0, row]
    for lag in range(1, a.shape[2] + 1):
        value -= a[r, 0, lag - 1] * pv[row - lag]
        value += b[r, 0, 0, lag - 1] * draws.stems[r, 0, row - lag - delay[0, 0]]
    assert value == pytest.approx(pv[row], abs=1e-9)
    assert not np.allclose(a[r], a[0])


def test_a_valve_that_is_undecided_is_drawn_with_friction_and_without(
    record: Record, found: Identification
) -> None:
    valve = found.valves[0]
    doubted = dataclasses.replace(
        valve, verdict=VerdictKind.UNDECIDED, static_interval=(0.0, valve.static_interval[1])
    )
    doubt = dataclasses.replace(found, valves=(doubted,))
    draws = drawn(RecordedLoop.of(record, doubt))
    assert draws.likeliest == 2
    assert draws.frictions[0, 0] == valve.static_friction
    assert not draws.frictions[1::2].any()
    assert np.all(draws.frictions[::2, 0] >= valve.static_friction)
    service = gain_of(record, doubt).option(What.SERVICE)
    assert service.measures is None


def test_backlash_is_planned_without_a_least_jump(found: Identification) -> None:
    valve = found.valves[0]
    assert pair_of(valve) == (valve.static_friction, valve.dynamic_friction)
    static, dynamic = pair_of(dataclasses.replace(valve, jump=0.0))
    assert static == dynamic == 0.5 * (valve.static_friction + valve.dynamic_friction)


@pytest.mark.trial
def test_the_same_record_gives_the_same_answer(
    gain: Gain, record: Record, found: Identification
) -> None:
    assert gain_of(record, found).to_dict() == gain.to_dict()


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


@pytest.mark.trial
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


@pytest.mark.parametrize(("band", "many"), [((4.0, 5.0), 20), ((4.98, 5.0), 2), ((9.0, 9.1), 1)])
def test_possible_frictions_have_a_possible_band(
    found: Identification, band: tuple[float, float], many: int
) -> None:
    valve = dataclasses.replace(
        found.valves[0],
        static_friction=2.6,
        static_interval=(2.0, 4.0),
        dynamic_friction=2.4,
        dynamic_interval=(1.0, 3.5),
        band_interval=band,
    )
    pairs = possible_frictions(valve, 20, np.random.default_rng(0))
    assert pairs.shape == (20, 2)
    assert tuple(pairs[0]) == (2.6, 2.4)
    others = pairs[np.any(pairs != pairs[0], axis=1)]
    assert len(others) >= many - 1
    assert np.all((others >= (2.0, 1.0)) & (others <= (4.0, 3.5)))
    assert np.all(others[:, 1] <= others[:, 0])
    assert np.all((others.sum(axis=1) >= band[0]) & (others.sum(axis=1) <= band[1]))


def test_jumps_are_less_certain_than_bands(loop: RecordedLoop) -> None:
    likely = loop.drawn(np.random.default_rng(5)).frictions
    possible = loop.possible(np.random.default_rng(5)).frictions
    spreads = [np.std(pairs[:, 0] - pairs[:, 1]) for pairs in (likely, possible)]
    assert spreads[0] < spreads[1]


@pytest.mark.trial
def test_loops_that_grow_without_end_are_told(
    record: Record, found: Identification, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stiction_ros.gain.gain.embedded", lambda part, *_: [part.now(), None])
    embedding = gain_of(record, found).option(What.EMBEDDING)
    assert embedding.measures is None
    assert "In 1 of them the loop grows without end." in embedding.note


@pytest.mark.trial
def test_nothing_is_said_of_a_controller_that_is_faster_than_the_record_shows(
    record: Record, found: Identification, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stiction_ros.gain.gain.FASTEST", 0.1)
    embedding = gain_of(record, found).option(What.EMBEDDING)
    assert embedding.measures is None
    assert "times as fast as the recorded loop" in embedding.note


def test_frictions_are_taken_as_often_as_they_are_likely() -> None:
    pairs = np.array([[3.0, 1.0], [4.0, 2.0], [5.0, 3.0]])
    losses = np.array([2.0, 0.0, 400.0])
    random = np.random.default_rng(1)
    found = np.vstack([resampled(pairs, losses, VerdictKind.STICKY, random) for _ in range(40)])
    assert tuple(found[0]) == (3.0, 1.0)
    assert not np.any(found[:, 0] == 5.0)
    share = float(np.mean(np.delete(found[:, 0], np.s_[::DRAWS]) == 3.0))
    assert share == pytest.approx(np.exp(-1.0) / (1.0 + np.exp(-1.0)), abs=0.06)
    assert not resampled(pairs, losses, VerdictKind.HEALTHY, random).any()
    undecided = resampled(pairs, losses, VerdictKind.UNDECIDED, random)
    assert undecided[::2].all()
    assert not undecided[1::2].any()


def of_law(law: str) -> LoopModel:
    friction = from_mapping({"effect": "stiction", "law": law, **PARAMETERS[law]})
    valve = {**MODEL["valves"][0], "effects": [friction.to_mapping()]}  # type: ignore[index]
    return LoopModel.from_mapping({**MODEL, "valves": [valve]})


PARAMETERS = {
    "kano": {"s": 5.5, "j": 2.5},
    "choudhury": {"s": 5.5, "j": 2.5},
    "semi_physical": {"f_s": 4.0, "f_d": 1.5, "k": 1.4},
}


@pytest.mark.trial
@pytest.mark.parametrize("law", PARAMETERS)
def test_a_loop_is_run_again_by_the_law_that_was_identified(law: str) -> None:
    """With the true estimate the loop repeats its record, until a slip hangs on rounding."""
    model = of_law(law)
    assert model.controller is not None
    control = PiController(model.controller, 1.0, 50.0, (0.0, 100.0))
    moves = SetPoints(("PV1",), np.array([0.0, 20.0]), np.array([[50.0], [53.0]]))
    run = simulate_closed_loop(model, control, moves, 1500, 3).record
    assert run.stem is not None
    found = identify(run, IdentificationOptions("exact", output_order=1, delay=(2, 2)))
    friction = model.valves[0].effects[0]
    assert isinstance(friction, Stiction)
    (estimate,) = found.valves
    further = {"k": 1.4} if law == "semi_physical" else {}
    estimate = dataclasses.replace(estimate, law=law, further=further).with_frictions(4.0, 1.5)
    true = dataclasses.replace(found, valves=(estimate,), stem=run.stem)
    loop = RecordedLoop.of(run, true)
    draws = drawn(loop)
    stem = loop.op_scale * draws.stems[0, 0] + loop.loop.op_mean[0]
    assert stem == pytest.approx(run.stem[loop.begin : loop.rows[1], 0], abs=1e-6)
    again, now = loop.run(draws)[0], loop.now()
    assert again is not None
    assert again.iae_per_hour == pytest.approx(now.iae_per_hour, rel=0.05)
    assert again.moves_per_hour == pytest.approx(now.moves_per_hour, rel=0.05)
    assert type(EmbeddingDesign.of(loop).friction) is type(friction)


@pytest.mark.trial
@pytest.mark.parametrize("law", ["kano", "choudhury"])
def test_the_law_of_a_model_is_embedded(law: str) -> None:
    assert gain_of_model(of_law(law), samples=300).option(What.EMBEDDING).measures is not None


def test_a_tuning_that_makes_the_cycle_wider_does_not_help() -> None:
    now = Measures(1.0, 1.0, 0.0, 0.0, 0.0)
    calmer, wider = Tuning(0.5), Tuning(2.0)
    runs = {
        UNCHANGED: [now],
        calmer: [dataclasses.replace(now, iae_per_hour=0.9)],
        wider: [dataclasses.replace(now, iae_per_hour=0.5, amplitude=1.1)],
    }
    assert most_helpful(runs) == calmer
    del runs[calmer]
    assert most_helpful(runs) == UNCHANGED


def test_the_amplitude_of_another_tuning_is_that_of_its_own_cycle(
    loop: RecordedLoop, draws: Draws
) -> None:
    """At the period of now a tuning that makes the cycle faster, and wider, seemed to end it."""
    first, now = draws.taken([0]), loop.now()
    (run,) = loop.run(first, tunings=Tuning(2.0).applied(first.tunings))
    assert run is not None
    assert now.amplitude is not None
    assert now.period is not None
    assert run.amplitude is not None
    assert run.period is not None
    assert run.period < 0.8 * now.period
    assert run.amplitude > now.amplitude


def test_a_note_says_on_which_measure_the_drawn_loops_do_not_agree() -> None:
    now = Measures(0.0081, 0.0354, 0.0, 0.0, 0.0)
    measures = Measures(0.003, 0.0205, 0.0, 0.0, 0.0)
    interval = {"amplitude": (0.0013, 0.0055), "iae_per_hour": (0.0198, 0.0211)}
    option = Option(What.SERVICE, measures, interval, "").where_agreed(now)
    assert option.measures is None
    assert option.interval == interval
    assert "do not agree on its amplitude (0.0013 to 0.0055, now 0.0081)" in option.note
    assert "agree on its mean |PV−SP| alone is not enough" in option.note
