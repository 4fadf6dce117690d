from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from evidence_loops import pi_loop

from stiction_ros.identification import IdentificationOptions, VerdictKind, identify
from stiction_ros.identification.closed_loop.explanation import MATERIAL
from stiction_ros.identification.evidence import engine
from stiction_ros.identification.evidence.rates import PRICE, Look, looks
from stiction_ros.identification.evidence.verdict import (
    ANOTHER,
    AS_RECORDED,
    GAINED,
    HARDLY,
    LEAST_GONE,
    MATTERS,
    SURELY,
    WIDER,
    acquits,
    confirms,
    doubted,
)
from stiction_ros.identification.result.cause import Cause, CauseKind
from stiction_ros.identification.result.identification import Identification, ValveEstimate
from stiction_ros.records.parts import longest_part
from stiction_studies.field import field_loop


def test_the_whole_way_from_a_record_to_valve_process_and_cause() -> None:
    found = identify(pi_loop(3.0, 1.0), IdentificationOptions(method="evidence"))
    valve, output = found.valves[0], found.outputs[0]
    assert found.method == "evidence"
    assert found.to_json()["rate"] == {"sample_time": 1.0, "used": valve.evidence["rate"]}
    assert valve.stability is not None
    assert [look.name for look in valve.stability.tried] == [
        *("rows of 1 s", "rows of 2 s", "rows of 4 s", "first half", "second half")
    ]
    assert valve.stability.share == 1.0
    assert valve.verdict is VerdictKind.STICKY
    assert valve.static_interval[0] <= 3.0 <= valve.static_interval[1]
    assert valve.dynamic_interval[0] <= 1.0 <= valve.dynamic_interval[1]
    assert output.delay["V1"] == 2  # PV shows a stem three samples later
    assert sum(output.b["V1"]) / (1.0 + sum(output.a)) == pytest.approx(1.0, abs=0.1)


@pytest.mark.trial
def test_the_range_of_delays_plays_no_part_in_what_is_said_of_the_valve() -> None:
    record = pi_loop(3.0, 1.0)
    options = [IdentificationOptions(method="evidence", delay=(0, high)) for high in (5, 20, 40)]
    valves = [identify(record, each).valves[0] for each in options]
    assert len({(v.verdict, v.static_friction, v.static_interval) for v in valves}) == 1


def test_an_ideal_valve_is_not_called_sticky() -> None:
    for seed in range(3):
        found = identify(pi_loop(0.0, 0.0, seed=seed), IdentificationOptions(method="evidence"))
        assert found.valves[0].verdict is not VerdictKind.STICKY


def test_what_a_historian_held_is_looked_at_from_report_to_report() -> None:
    record = pi_loop(3.0, 1.0, samples=1600, noise=0.1)
    slow = record.pv.copy()
    slow[1::2] = slow[::2]  # reported every other sample
    held = dataclasses.replace(record, pv=slow)
    valve = identify(held, IdentificationOptions(method="evidence")).valves[0]
    assert valve.verdict is VerdictKind.STICKY
    assert "gain_1" not in valve.evidence
    assert valve.evidence["gain_2"] > 0.0
    assert valve.static_interval[0] <= 3.0 <= valve.static_interval[1]


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({}, VerdictKind.STICKY),
        ({"wave_2": 90.0, "outside_line": 50.0, "share": 0.35}, VerdictKind.UNDECIDED),
        ({"wave_2": 90.0, "outside_line": 50.0, "share": 0.25}, VerdictKind.STICKY),
        ({"wave_2": 90.0, "outside_line": -5.0, "share": 0.35}, VerdictKind.STICKY),
        ({"outside_line": 50.0, "share": 0.35}, VerdictKind.STICKY),
        ({"loop_gone": 0.01, "controller_fit": 0.99}, VerdictKind.UNDECIDED),
        ({"loop_gone": 0.01, "controller_fit": 0.5}, VerdictKind.STICKY),
        ({"loop_gone": 0.01, "delta_bic": 60.0}, VerdictKind.STICKY),
        ({"moved_with": 1.1 * ANOTHER}, VerdictKind.UNDECIDED),
        ({"moved_with": 0.9 / ANOTHER}, VerdictKind.UNDECIDED),
        ({"moved_with": 0.9 * ANOTHER}, VerdictKind.STICKY),
        ({"moved_with": 1.1 * ANOTHER, "controller_fit": 0.5}, VerdictKind.STICKY),
        ({"moved_with": 1.1 * ANOTHER, "delta_bic": 60.0}, VerdictKind.STICKY),
        ({"outside_line": 5.0, "line_rivalry": 0.4, "held": 0.0}, VerdictKind.UNDECIDED),
        ({"outside_line": 5.0, "line_rivalry": 0.4, "held": 1.0}, VerdictKind.STICKY),
        ({"outside_line": 5.0, "line_rivalry": 0.2, "held": 0.0}, VerdictKind.STICKY),
        ({"outside_line": -5.0, "line_rivalry": 0.4, "held": 0.0}, VerdictKind.STICKY),
        ({"echo": 26.0}, VerdictKind.UNDECIDED),
        ({"echo": 26.0, "outside_line": 70.0}, VerdictKind.STICKY),
        ({"echo": 24.0}, VerdictKind.STICKY),
    ],
)
def test_the_loop_takes_back_what_is_a_wave_itself_or_idle(
    changes: dict[str, float], verdict: VerdictKind
) -> None:
    plain = {
        "delta_bic": 20.0,
        "share": 0.1,
        "outside_line": -5.0,
        "loop_gone": 0.5,
        "moved_with": 1.0,
        "controller_fit": 0.99,
    }
    valve = ValveEstimate(
        name="V1",
        verdict=VerdictKind.STICKY,
        law="he",
        static_friction=3.0,
        static_interval=(2.5, 3.5),
        dynamic_friction=1.0,
        dynamic_interval=(0.5, 1.5),
        jump=2.0,
        stem_start=50.0,
        moves=40,
        evidence=plain | changes,
    )
    for share, taken_back in ((0.9 * MATTERS, True), (1.1 * WIDER, True), (0.5, False)):
        other = doubted(dataclasses.replace(valve, band_share=share)).verdict
        assert other is (VerdictKind.UNDECIDED if taken_back else verdict)
    found = doubted(valve)
    assert found.verdict is verdict
    assert found.static_interval[0] == (2.5 if verdict is VerdictKind.STICKY else 0.0)
    play = doubted(dataclasses.replace(valve, verdict=VerdictKind.BACKLASH))
    taken_back = verdict is VerdictKind.UNDECIDED
    assert play.verdict is (VerdictKind.UNDECIDED if taken_back else VerdictKind.BACKLASH)
    assert play.static_interval == found.static_interval
    for kind in (VerdictKind.HEALTHY, VerdictKind.UNDECIDED):
        other = dataclasses.replace(valve, verdict=kind)
        assert doubted(other) == other


@pytest.fixture(scope="module")
def told() -> Identification:
    """A sticky valve whose loop moves as recorded, and a third less without the friction."""
    return with_loop(identify(pi_loop(3.0, 1.0)))


def with_loop(
    found: Identification, *, kind: CauseKind = CauseKind.NONE, **changes: float
) -> Identification:
    """Return an identification whose first valve and output say something else."""
    loop = {"controller_fit": 0.99, "moved_with": 1.0, "loop_gone": 0.33} | changes
    valve = dataclasses.replace(found.valves[0], evidence=loop)
    cause = Cause(kind, None, 0.0, 0.0, "")
    output = dataclasses.replace(found.outputs[0], cause=cause)
    return dataclasses.replace(found, valves=(valve,), outputs=(output,))


@pytest.mark.parametrize(
    ("changes", "confirmed"),
    [
        ({}, True),
        ({"moved_with": 0.99 / AS_RECORDED}, False),
        ({"moved_with": 1.01 * AS_RECORDED}, False),
        ({"loop_gone": 0.9 * LEAST_GONE}, False),
        ({"controller_fit": 0.8}, False),
        ({"kind": CauseKind.UNKNOWN}, True),
        ({"kind": CauseKind.VALVE}, True),
        ({"kind": CauseKind.TUNING}, False),
        ({"kind": CauseKind.DISTURBANCE}, False),
        ({"kind": CauseKind.SET_POINT}, False),
    ],
)
def test_a_loop_confirms_a_friction_without_which_it_moves_less_and_nothing_else_explains_it(
    told: Identification, changes: dict[str, Any], confirmed: bool
) -> None:
    assert confirms(with_loop(told, **changes), 0) is confirmed


def test_a_friction_that_one_rate_shows_counts_where_its_loop_confirms_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A record slower than its controller, of the field: no mean of samples shows it."""
    record = longest_part([field_loop(380).record])
    valve = identify(record).valves[0]
    assert valve.verdict.has_friction
    assert valve.evidence["gain_1"] > 2 * PRICE > 2 * valve.evidence["gain_2"]
    assert valve.evidence["rate"] == 1.0
    monkeypatch.setattr(engine, "confirms", lambda found, valve: False)
    assert identify(record).valves[0].verdict is VerdictKind.UNDECIDED


@pytest.fixture(scope="module")
def quiet() -> Look:
    """A rate at which every friction that matters is rejected."""
    look = looks(pi_loop(0.0, 0.0, samples=200), IdentificationOptions())[0]
    lost = dataclasses.replace(look.accepted[0], gain=0.0, material_gain=-1.1 * SURELY)
    return dataclasses.replace(look, accepted=(lost,))


@pytest.mark.parametrize(
    ("changes", "acquitted"),
    [
        ({}, True),
        ({"controller_fit": 0.8}, False),
        ({"moved_without": 0.99 / AS_RECORDED}, False),
        ({"moved_without": 1.01 * AS_RECORDED}, False),
        ({"loop_gone": 1.1 * HARDLY}, False),
        ({"kind": CauseKind.UNKNOWN}, True),
        ({"kind": CauseKind.VALVE}, True),
        ({"kind": CauseKind.DISTURBANCE}, False),
        ({"kind": CauseKind.TUNING, "loop_gone": 1.1 * HARDLY}, True),
        ({"kind": CauseKind.SET_POINT, "loop_gone": 1.1 * HARDLY}, True),
        ({"kind": CauseKind.TUNING, "loop_gone": 1.1 * MATERIAL}, False),
    ],
)
def test_a_loop_acquits_a_valve_where_it_moves_as_recorded_without_friction(
    told: Identification, quiet: Look, changes: dict[str, Any], acquitted: bool
) -> None:
    plain = {"moved_without": 1.0, "loop_gone": 0.9 * HARDLY}
    found = with_loop(told, **(plain | changes))
    assert acquits(found, (quiet,), 0) is acquitted


def test_a_loop_that_does_not_cycle_acquits_no_valve_alone(
    told: Identification, quiet: Look
) -> None:
    plain = {"moved_without": 1.0, "loop_gone": 0.0}
    found, rings = with_loop(told, **plain), with_loop(told, kind=CauseKind.TUNING, **plain)
    open_ = dataclasses.replace(quiet.accepted[0], material_gain=-0.9 * SURELY)
    seen = (dataclasses.replace(quiet, accepted=(open_,)),)
    assert not acquits(found, seen, 0)
    assert acquits(rings, seen, 0)


@pytest.mark.parametrize(("gain", "acquitted"), [(0.9 * GAINED, True), (1.1 * GAINED, False)])
def test_a_loop_that_does_not_cycle_acquits_no_valve_where_a_rate_gains_by_what_matters(
    told: Identification, quiet: Look, gain: float, acquitted: bool
) -> None:
    found = with_loop(told, moved_without=1.0, loop_gone=0.0)
    other = dataclasses.replace(quiet.accepted[0], material_gain=gain)
    seen = (quiet, dataclasses.replace(quiet, accepted=(other,)))
    assert acquits(found, seen, 0) is acquitted


def test_a_loop_acquits_no_valve_in_which_a_rate_finds_friction(
    told: Identification, quiet: Look
) -> None:
    rings = with_loop(told, kind=CauseKind.TUNING, moved_without=1.0, loop_gone=0.0)
    for gain, acquitted in ((0.9 * PRICE, True), (1.1 * PRICE, False)):
        held = dataclasses.replace(quiet.accepted[0], gain=gain)
        seen = (quiet, dataclasses.replace(quiet, accepted=(held,)))
        assert acquits(rings, seen, 0) is acquitted


def test_a_valve_of_a_loop_that_rings_is_healthy_where_no_friction_is_needed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Rates leave it open in this loop of the field, which moves as recorded without friction."""
    record = longest_part([field_loop(229).record])
    found = identify(record)
    assert found.valves[0].verdict is VerdictKind.HEALTHY
    assert found.valves[0].static_friction == 0.0
    assert found.outputs[0].cause is not None
    assert found.outputs[0].cause.kind is CauseKind.TUNING
    monkeypatch.setattr(engine, "acquits", lambda found, seen, valve: False)
    assert identify(record).valves[0].verdict is VerdictKind.UNDECIDED
