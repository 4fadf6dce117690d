from collections import Counter
from types import SimpleNamespace
from typing import Any, cast

import pytest

from stiction_ros.online.input.port import InputPort
from stiction_ros.online.input.port_health import PortHealth, keys


def port(**changed: Any) -> InputPort:
    """Return what is asked of a port; ``ages`` are those at any time."""
    usual: dict[str, Any] = {"ages": {"pv": 0.1, "sp": 0.1, "op_applied": 0.1}}
    usual |= {"period": 1.0, "behind": 0, "waiting": 0, "lacks": "", "counts": {}}
    told = SimpleNamespace(**(usual | changed))
    told.ages, told.counts = (lambda ages: lambda _now: ages)(told.ages), Counter(told.counts)
    return cast("InputPort", told)


# port, s since the node runs -> names and levels
TABLE: dict[str, tuple[InputPort, float, list[tuple[str, str]]]] = {
    "well": (port(), 100.0, []),
    "no pv": (port(ages={"pv": 3.1}), 100.0, [("pv", "error")]),
    "pv a little late": (port(ages={"pv": 2.9}), 100.0, []),
    "fast samples have half a second": (port(ages={"pv": 0.4}, period=0.01), 100.0, []),
    "and no more": (port(ages={"pv": 0.6}, period=0.01), 100.0, [("pv", "error")]),
    "no pv ever": (port(ages={}), 3.1, [("pv", "error")]),
    "just begun": (port(ages={}), 0.1, []),
    "just begun again": (port(ages={"pv": 60.0}), 0.1, []),
    "no sp ever": (port(lacks="sp", waiting=3), 9.0, [("start", "error")]),
    "the first samples": (port(lacks="sp", waiting=2), 9.0, []),
    "nobody tells any more": (
        port(ages={"pv": 0.1, "op_applied": 4.0}),
        100.0,
        [("op_applied", "warn")],
    ),
    "nobody ever told": (port(ages={"pv": 0.1}), 100.0, []),
    "behind": (port(behind=7), 100.0, [("behind", "warn")]),
}


@pytest.mark.parametrize("case", TABLE)
def test_what_is_noticed(case: str) -> None:
    found, running, noticed = TABLE[case]
    look = PortHealth(found).look(0.0, running)
    assert [(name, level) for name, level, _ in look] == noticed


def test_lockstep_knows_no_period() -> None:
    for age, levels in ((4.9, []), (5.1, ["error"])):
        health = PortHealth(port(ages={"pv": age}, period=0.0))
        assert [notice.level for notice in health.look(0.0, 100.0)] == levels


def test_what_was_counted_is_noticed_once() -> None:
    counted = port(counts={"stale": 2, "late": 1})
    health = PortHealth(counted)
    assert [notice.name for notice in health.look(0.0, 9.0)] == ["stale", "late"]
    assert health.look(0.0, 9.0) == []
    counted.counts["stale"] = 3
    (again,) = health.look(0.0, 9.0)
    assert (again.name, again.level, again.text) == (
        "stale",
        "warn",
        "PV with stamps of the past: 3",
    )


def test_keys_tell_ages_in_seconds_and_samples_and_all_counts() -> None:
    told = dict(keys(port(ages={"pv": 0.5}, period=0.1, counts={"late op": 2}), 0.0))
    assert told["pv_age"] == "0.500"
    assert told["pv_age_samples"] == "5.0"
    assert told["sp_age"] == ""
    assert (told["late_op"], told["stale"], told["samples_behind"]) == (2, 0, 0)
