"""The exact search on loops whose truth is known."""

import dataclasses
import json

import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.errors import InputError
from stiction_ros.identification import FitStatus, IdentificationOptions, VerdictKind, identify
from stiction_ros.records.record import Record

EXACT = IdentificationOptions("exact")
THIRD_ORDER = IdentificationOptions("exact", output_order=3, input_order=3)


@pytest.mark.parametrize("noise", ["measurement", "equation"])
def test_example1_for_both_noise_placements(noise: str) -> None:
    record = loops.example1(1, noise)
    seen: list[float] = []
    found = identify(record, THIRD_ORDER, seen.append)
    valve, output = found.valves[0], found.outputs[0]
    assert found.status is FitStatus.OK
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    assert valve.verdict is VerdictKind.STICKY
    assert valve.static_friction == pytest.approx(5.0, abs=0.1)
    assert valve.dynamic_friction == pytest.approx(2.0, abs=0.1)
    assert valve.static_interval[0] <= valve.static_friction <= valve.static_interval[1]
    assert output.delay == {"V1": 5}
    assert output.noise_std == pytest.approx(0.01, rel=0.06)
    assert output.fit_free_run > 70.0
    assert record.stem is not None
    assert np.sqrt(np.mean((found.stem - record.stem) ** 2)) < 0.3
    assert valve.evidence["stem_error"] == pytest.approx(np.mean((found.stem - record.stem) ** 2))
    assert not found.stem.flags.writeable


def test_output_model_simulates_the_record() -> None:
    record = loops.example1(1)
    found = identify(record, THIRD_ORDER)
    output = found.outputs[0]
    b, delay = output.b["V1"], output.delay["V1"]
    y = record.pv[:, 0].copy()
    for k in range(20, len(y)):
        y[k] = output.bias - sum(a * y[k - i - 1] for i, a in enumerate(output.a))
        y[k] += sum(c * found.stem[k - i - 1 - delay, 0] for i, c in enumerate(b))
    error = np.sqrt(np.mean((y - record.pv[:, 0])[300:] ** 2))
    assert error < 0.1 * record.pv.std()


def test_two_valves_two_outputs() -> None:
    options = IdentificationOptions("exact", output_order=2, input_order=2, delay=(0, 0))
    sticky, healthy = identify(loops.tank(1), options).valves
    assert sticky.verdict is VerdictKind.STICKY
    assert sticky.static_friction == pytest.approx(8.0, abs=0.3)
    assert sticky.dynamic_friction == pytest.approx(1.0, abs=0.3)
    assert healthy.verdict is VerdictKind.HEALTHY
    assert healthy.static_friction <= 0.3


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("period", [None, 37.0])
def test_no_friction_is_never_sticky(seed: int, period: float | None) -> None:
    samples = 1200
    sine = None if period is None else 0.3 * np.sin(2 * np.pi * np.arange(samples) / period)
    record = loops.example1(seed, friction=(0.0, 0.0), samples=samples, gain=2.8, disturbance=sine)
    assert identify(record, EXACT).valves[0].verdict is VerdictKind.HEALTHY


def test_compensated_window_gives_a_wide_interval() -> None:
    valve = identify(loops.compensated(0), THIRD_ORDER).valves[0]
    low, high = valve.static_interval
    assert low <= 5.0 <= high
    assert high - low > 1.5
    assert valve.verdict is not VerdictKind.HEALTHY


def test_valve_that_never_slips_is_undecided() -> None:
    generator = np.random.default_rng(0)
    op = 50.0 + np.sin(np.arange(800) / 9.0)
    pv = 20.0 + 0.1 * generator.standard_normal(800)
    record = Record("still", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None])
    assert identify(record).valves[0].verdict is VerdictKind.UNDECIDED


def test_json_has_the_keys_of_the_contract() -> None:
    found = identify(loops.example1(0, samples=800), THIRD_ORDER).to_dict()
    assert json.loads(json.dumps(found)).keys() == found.keys()
    assert {*("samples", "sample_time", "seconds", "model"), *("rate", "valves", "outputs")} == (
        found.keys()
    )
    assert found["rate"] == {"sample_time": 1.0, "used": 1.0}
    assert found["valves"][0].keys() == {
        *("name", "verdict", "law", "f_s", "f_s_interval", "f_d", "f_d_interval", "jump"),
        *("band_interval", "band_share", "stability", "evidence", "experiment", "responds"),
        "probability",
    }
    stability = found["valves"][0]["stability"]
    assert stability["agreed"] == [look["look"] for look in stability["tried"]]
    assert stability["agreed"] == ["first half", "second half"]
    assert found["outputs"][0].keys() == {
        *("name", "a", "b", "delay", "bias", "noise_std", "fit_one_step", "fit_free_run"),
        "cause",
    }
    assert found["outputs"][0]["cause"].keys() == {"kind", "period", "regularity", "amplitude"}


def test_same_record_gives_the_same_result() -> None:
    record = loops.example1(0, samples=800)
    first, second = (identify(record, THIRD_ORDER) for _ in range(2))
    assert first.valves == second.valves
    assert first.outputs == second.outputs


@pytest.mark.parametrize("key", ["op", "pv"])
def test_constant_signal_is_refused(key: str) -> None:
    record = loops.example1(0, samples=400)
    record = dataclasses.replace(record, **{key: np.full((400, 1), 50.0)})
    with pytest.raises(InputError, match="constant"):
        identify(record)


def test_short_record_is_refused() -> None:
    with pytest.raises(InputError, match="too few"):
        identify(loops.example1(0, samples=400).part(0, 20))


def test_unknown_law_is_refused() -> None:
    with pytest.raises(InputError, match=r"law: unknown friction law .*; use choudhury \| he"):
        identify(loops.example1(0, samples=400), IdentificationOptions(law="nobody"))


@pytest.mark.parametrize(
    "wrong", [{"delay": (3, 1)}, {"output_order": 0}, {"friction_limit": 0.0}, {"confidence": 1.5}]
)
def test_options_are_checked(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError):
        IdentificationOptions(**wrong)  # type: ignore[arg-type]


@pytest.mark.trial
def test_orders_that_were_compared_are_listed() -> None:
    found = identify(loops.example1(0, samples=900))
    assert [row.output_order for row in found.orders] == [1, 2, 3]
    assert found.to_dict()["model"]["orders"][0].keys() == {
        *("output_order", "input_order", "aic", "bic")
    }
    best = min(found.orders, key=lambda row: row.bic)
    assert len(found.outputs[0].a) == best.output_order


def test_delays_that_cannot_be_told_apart_are_named() -> None:
    notes = identify(loops.example1(1, samples=1200), THIRD_ORDER).notes
    assert any("delays 4, 5 of V1 to PV1" in note for note in notes)


def test_friction_that_could_sit_in_either_of_two_valves_is_named() -> None:
    record = loops.example1(0, samples=900)
    twins = Record("twins", 1.0, ("V1", "V2"), ("PV1",), np.repeat(record.op, 2, axis=1), record.pv)
    noise = 1e-6 * np.random.default_rng(0).standard_normal(twins.op.shape)
    twins = dataclasses.replace(twins, op=twins.op + noise)
    options = dataclasses.replace(THIRD_ORDER, delay=(5, 5))
    notes = identify(twins, options).notes
    assert any("friction in V" in note and "as well as in V" in note for note in notes)


def test_swapped_columns_are_refused() -> None:
    record = loops.example1(0, samples=900)
    with pytest.raises(InputError, match="look swapped"):
        identify(dataclasses.replace(record, op=record.pv, pv=record.op))
