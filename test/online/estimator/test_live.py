import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
import yaml

from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError
from stiction_ros.identification import (
    FitStatus,
    Identification,
    IdentificationOptions,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.loop import LoopModel
from stiction_ros.online.estimator.live import EstimatorSettings, FitUpdate, LiveEstimator, fit
from stiction_ros.records import Record

SETTINGS = EstimatorSettings(
    fit_first=20, fit_every=10, fit_latency=5, window=30, confirmations=1, tolerance=0.0
)
OUTPUT = OutputModel("PV1", (-0.9,), {"V1": (0.1,)}, {"V1": 2}, 0.5, 0.01, 99.0, 90.0)


def estimator(settings: EstimatorSettings = SETTINGS) -> LiveEstimator:
    return LiveEstimator(settings, "loop", ["V1"], ["PV1"], 2.0)


def found(
    f_s: float = 5.0,
    verdict: VerdictKind = VerdictKind.STICKY,
    half: float = 0.5,
    outputs: tuple[OutputModel, ...] = (OUTPUT,),
) -> Identification:
    f_s_interval = (max(f_s - half, 0.0), f_s + half)
    valve = ValveEstimate(
        "V1", verdict, "he", f_s, f_s_interval, 2.0, (1.8, 2.2), f_s - 2.0, 0.0, 40, {}
    )
    return Identification(
        FitStatus.OK, "", "exact", 30, 2.0, 0.1, (valve,), outputs, np.zeros((30, 1))
    )


def concluded(*fits: Identification, settings: EstimatorSettings = SETTINGS) -> list[FitUpdate]:
    live = estimator(settings)
    return [live.conclude(19 + 10 * i, fit) for i, fit in enumerate(fits)]


@pytest.mark.parametrize(
    ("bad", "lengths"),
    [([25], [20, 30, 30, 30]), ([39], [20, 30, 30, 30]), (range(24, 30), [20, 0, 10, 20])],
)
def test_a_window_begins_anew_where_too_many_samples_lack(
    bad: Sequence[int], lengths: list[int]
) -> None:
    live, due = estimator(), list[Record]()
    for k in range(50):
        pv = np.nan if k in bad else 1.0 * k
        record = live.add(k, np.array([float(k)]), np.array([pv]))
        due += [] if record is None else [record]
    assert [len(record) for record in due] == lengths
    assert all(np.isfinite(record.pv).all() for record in due)


def test_a_window_is_due_by_the_schedule_and_slides() -> None:
    live, due = estimator(), {}
    for k in range(60):
        record = live.add(k, np.array([float(k)]), np.array([-float(k)]))
        if record is not None:
            due[k] = record
    assert list(due) == [19, 29, 39, 49, 59]
    assert [len(r) for r in due.values()] == [20, 30, 30, 30, 30]
    assert due[49].op[:, 0].tolist() == list(range(20, 50))
    assert due[49].pv[:, 0].tolist() == [-k for k in range(20, 50)]
    assert due[49].start == 20 * 2.0
    assert (due[49].valves, due[49].outputs, due[49].sample_time) == (("V1",), ("PV1",), 2.0)


def test_a_window_does_not_change_when_more_comes_in() -> None:
    live, mine = estimator(), np.array([1.0])
    for k in range(19):
        live.add(k, mine, mine)
    record = live.add(19, mine, mine)
    mine[0] = 9.0
    live.add(20, mine, mine)
    assert record is not None
    assert np.all(record.op == 1.0)


@pytest.mark.parametrize("law", ["he", "kano", "choudhury", "xch", "auto"])
def test_every_law_is_asked_for(law: str) -> None:
    options = EstimatorSettings(law=law).options()
    assert (options.law, options.method) == (law, "exact")


def test_a_law_that_is_not_identified_is_refused() -> None:
    with pytest.raises(InputError, match=r"law: unknown friction law .* mean kano"):
        EstimatorSettings(law="kanu").options()
    with pytest.raises(InputError, match="law: semi_physical is not identified in a running loop"):
        EstimatorSettings(law="semi_physical").options()


def test_a_law_left_open_is_kept_once_it_is_trusted() -> None:
    live = estimator(dataclasses.replace(SETTINGS, law="auto"))
    assert live.options().law == "auto"
    fit = found()
    kano = dataclasses.replace(fit.valves[0], law="kano")
    live.conclude(19, dataclasses.replace(fit, valves=(kano,)))
    assert live.options().law == "kano"


def test_a_law_left_open_is_that_of_the_default_search(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, str]] = []

    def told(record: Record, options: IdentificationOptions) -> Identification:
        asked.append((options.method, options.law))
        return dataclasses.replace(known, valves=tuple(valves))

    monkeypatch.setattr("stiction_ros.online.estimator.live.identify", told)
    known, options = found(), EstimatorSettings(law="auto").options()
    sticky = dataclasses.replace(known.valves[0], law="kano")
    healthy = dataclasses.replace(known.valves[0], verdict=VerdictKind.HEALTHY)
    record = Record("loop", 2.0, ("V1",), ("PV1",), np.zeros((30, 1)), np.zeros((30, 1)))
    valves = [sticky, healthy]
    fit(record, options)
    valves = [healthy]
    fit(record, options)
    assert asked == [("evidence", "auto"), ("exact", "kano"), ("evidence", "auto"), ("exact", "he")]
    valves, asked = [sticky, known.valves[0]], []
    assert [valve.law for valve in fit(record, options).valves] == ["kano", "he"]
    assert asked == [("evidence", "auto")]


def test_a_loop_model_comes_with_the_first_trust_only() -> None:
    updates = concluded(found(), found(), found())
    assert [update.loop_model is not None for update in updates] == [True, False, False]


def test_without_trust_there_is_no_loop_model() -> None:
    updates = concluded(*[found(verdict=VerdictKind.HEALTHY)] * 3)
    assert all(update.loop_model is None for update in updates)
    assert all(update.trusted == {} for update in updates)


def test_narrower_intervals_around_the_same_values_publish_nothing() -> None:
    updates = concluded(found(), found(half=0.1))
    assert updates[1].loop_model is None


def test_a_changed_friction_is_published() -> None:
    settings = dataclasses.replace(SETTINGS, contradictions=1)
    updates = concluded(found(), found(9.0), settings=settings)
    assert updates[1].loop_model is not None
    (valve,) = updates[1].loop_model.valves
    assert valve.effects == (HeStiction(9.0, 2.0),)


def test_the_end_of_trust_is_published() -> None:
    settings = dataclasses.replace(SETTINGS, contradictions=1)
    healthy = found(0.1, VerdictKind.HEALTHY, 0.1)
    updates = concluded(found(), healthy, healthy, settings=settings)
    assert updates[1].loop_model is not None
    assert updates[1].loop_model.valves[0].effects == ()
    assert updates[2].loop_model is None


def test_the_loop_model_says_what_was_identified() -> None:
    model = concluded(found())[0].loop_model
    assert model is not None
    again = LoopModel.from_yaml(model.to_yaml(valid_from=7))
    document = yaml.safe_load(model.to_yaml())
    assert again.valves[0].effects == (HeStiction(5.0, 2.0),)
    output = document["process"]["outputs"][0]
    assert (output["a"], output["b"], output["delay"]) == ([-0.9], {"V1": [0.1]}, {"V1": 2})
    assert document["provenance"][0]["f_s_interval"] == [4.5, 5.5]
    assert "sample 19" in document["provenance"][0]["from"]


def test_a_fit_without_a_model_changes_nothing() -> None:
    """An unusable fit may name no outputs; it must not end the estimator."""
    empty = dataclasses.replace(
        found(verdict=VerdictKind.UNDECIDED, outputs=()), status=FitStatus.NO_MODEL
    )
    updates = concluded(found(), empty, found())
    assert [update.loop_model is not None for update in updates] == [True, False, False]
    assert updates[1].trusted == updates[0].trusted


def test_orders_of_zero_are_chosen_from_the_data() -> None:
    options = EstimatorSettings(output_order=0, input_order=3, delay_low=1, delay_high=4).options()
    assert (options.output_order, options.input_order) == (None, 3)
    assert options.delay == (1, 4)


@pytest.mark.parametrize(
    "bad", [{"delay_low": 5, "delay_high": 4}, {"output_order": 11}, {"input_order": 11}]
)
def test_options_that_no_fit_can_use_are_refused_at_the_start(bad: dict[str, int]) -> None:
    with pytest.raises(InputError):
        estimator(dataclasses.replace(SETTINGS, **bad))


def test_new_settings_take_effect_without_losing_the_window() -> None:
    live = estimator()
    for k in range(19):
        live.add(k, np.array([float(k)]), np.zeros(1))
    live.retune(dataclasses.replace(SETTINGS, window=25, fit_first=22))
    records = [live.add(k, np.array([float(k)]), np.zeros(1)) for k in range(19, 32)]
    due = [19 + i for i, record in enumerate(records) if record is not None]
    assert due == [21, 31]
    last = records[-1]
    assert last is not None
    assert last.op[:, 0].tolist() == list(range(7, 32))


def test_new_settings_keep_what_is_trusted() -> None:
    live = estimator()
    live.conclude(19, found())
    live.retune(dataclasses.replace(SETTINGS, contradictions=1))
    update = live.conclude(29, found(9.0))
    assert update.trusted["V1"].static_friction == 9.0


def test_refused_settings_leave_the_old_ones() -> None:
    live = estimator()
    with pytest.raises(InputError):
        live.retune(dataclasses.replace(SETTINGS, delay_low=5, delay_high=4))
    assert live.settings is SETTINGS
