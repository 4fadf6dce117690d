from typing import Any

import pytest

from stiction_ros.online.input.port_health import PortHealth, keys
from stiction_ros.online.input.samples import PortState


def state(**changed: Any) -> PortState:
    usual: dict[str, Any] = {
        "ages": {"pv": 0.1, "sp": 0.1, "op_applied": 0.1},
        "period": 1.0,
        "behind": 0,
        "waiting": 0,
        "lacks": "",
        "counts": {},
    }
    return PortState(**(usual | changed))


# state, s since the node runs -> names and levels
TABLE: dict[str, tuple[PortState, float, list[tuple[str, str]]]] = {
    "well": (state(), 100.0, []),
    "no pv": (state(ages={"pv": 3.1}), 100.0, [("pv", "error")]),
    "pv a little late": (state(ages={"pv": 2.9}), 100.0, []),
    "fast samples have half a second": (state(ages={"pv": 0.4}, period=0.01), 100.0, []),
    "and no more": (state(ages={"pv": 0.6}, period=0.01), 100.0, [("pv", "error")]),
    "no pv ever": (state(ages={}), 3.1, [("pv", "error")]),
    "just begun": (state(ages={}), 0.1, []),
    "just begun again": (state(ages={"pv": 60.0}), 0.1, []),
    "no sp ever": (state(lacks="sp", waiting=3), 9.0, [("start", "error")]),
    "the first samples": (state(lacks="sp", waiting=2), 9.0, []),
    "nobody tells any more": (
        state(ages={"pv": 0.1, "op_applied": 4.0}),
        100.0,
        [("op_applied", "warn")],
    ),
    "nobody ever told": (state(ages={"pv": 0.1}), 100.0, []),
    "behind": (state(behind=7), 100.0, [("behind", "warn")]),
}


@pytest.mark.parametrize("case", TABLE)
def test_what_is_noticed(case: str) -> None:
    found, running, noticed = TABLE[case]
    look = PortHealth(lockstep=False).look(found, running)
    assert [(name, level) for name, level, _ in look] == noticed


def test_lockstep_knows_no_period() -> None:
    health = PortHealth(lockstep=True)
    assert health.look(state(ages={"pv": 4.9}, period=0.0), 100.0) == []
    assert [n.level for n in health.look(state(ages={"pv": 5.1}, period=0.0), 100.0)] == ["error"]


def test_what_was_counted_is_noticed_once() -> None:
    health = PortHealth(lockstep=False)
    assert [n.name for n in health.look(state(counts={"stale": 2, "late": 1}), 9.0)] == [
        "stale",
        "late",
    ]
    assert health.look(state(counts={"stale": 2, "late": 1}), 9.0) == []
    (again,) = health.look(state(counts={"stale": 3, "late": 1}), 9.0)
    assert (again.name, again.level, again.text) == (
        "stale",
        "warn",
        "PV with stamps of the past: 3",
    )


def test_keys_tell_ages_in_seconds_and_samples_and_all_counts() -> None:
    told = dict(keys(state(ages={"pv": 0.5}, period=0.1, counts={"late op": 2})))
    assert told["pv_age"] == "0.500"
    assert told["pv_age_samples"] == "5.0"
    assert told["sp_age"] == ""
    assert (told["late_op"], told["stale"], told["samples_behind"]) == (2, 0, 0)
