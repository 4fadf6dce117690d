import dataclasses

import pytest
from evidence_loops import pi_loop

from stiction_ros.identification import IdentificationOptions, VerdictKind, identify


def test_the_whole_way_from_a_record_to_valve_process_and_cause() -> None:
    found = identify(pi_loop(3.0, 1.0), IdentificationOptions(method="evidence"))
    valve, output = found.valves[0], found.outputs[0]
    assert found.method == "evidence"
    assert valve.figures is not None
    assert valve.probability is not None
    assert valve.evidence == valve.figures.to_dict()
    assert found.to_dict()["rate"] == {"sample_time": 1.0, "used": found.row_samples}
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


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.trial) for k in (1, 2))])
def test_an_ideal_valve_is_not_called_sticky(seed: int) -> None:
    found = identify(pi_loop(0.0, 0.0, seed=seed), IdentificationOptions(method="evidence"))
    assert found.valves[0].verdict is not VerdictKind.STICKY


@pytest.mark.trial
def test_friction_is_found_where_a_historian_held_every_other_sample() -> None:
    record = pi_loop(3.0, 1.0, samples=1600, noise=0.1)
    slow = record.pv.copy()
    slow[1::2] = slow[::2]  # reported every other sample
    held = dataclasses.replace(record, pv=slow)
    valve = identify(held, IdentificationOptions(method="evidence")).valves[0]
    assert valve.verdict is VerdictKind.STICKY
    assert valve.static_interval[0] <= 3.0 <= valve.static_interval[1]
