"""The faults between control system and bridge: their verdicts, their table, and one of them."""

import dataclasses
import os
from pathlib import Path
from typing import Any

import pytest

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_studies.control_system.journal import Allowed, Written, transfer_steps, written
from stiction_studies.faults.bridge.bridge_fault import BridgeFault, nothing
from stiction_studies.faults.bridge.bridged_loop import WATCHDOG
from stiction_studies.faults.bridge.case import Seen, judge
from stiction_studies.faults.bridge.catalogue import FAULTS, find, table
from stiction_studies.faults.observation import BagFound, Shown

PAGE = Path(__file__).parents[3] / "docs" / "opcua.md"
ALLOWED = Allowed(low=35.0, high=65.0, rate=0.05, sample_time=60.0, speed=600.0)
FAULT = BridgeFault("trouble", "is overcome", nothing, "trouble")
STEADY = dataclasses.replace(FAULT, taken_over=False)


def out(sample: int, wall: float, *values: float) -> dict[str, Any]:
    return {"event": "out", "sample": sample, "wall": wall, "out": list(values)}


def op(sample: int, wall: float, *values: float, taken: bool = True) -> dict[str, Any]:
    return {"event": "op", "sample": sample, "wall": wall, "op": list(values), "taken": taken}


def mode(sample: int, wall: float, name: str) -> dict[str, Any]:
    return {"event": "mode", "sample": sample, "wall": wall, "mode": name}


GRANTED = [out(0, 0.0, 50, 50), out(1, 0.1, 50.4, 50), mode(1, 0.11, "ROUT")]


@pytest.mark.parametrize(
    ("events", "found"),
    [
        ([op(1, 0.12, 50.4, 50), op(2, 0.22, 53.4, 50)], {"taken": 2, "beyond": 0.0}),
        ([op(1, 0.12, 50.4, 50), op(2, 0.22, 53.6, 50)], {"beyond": 0.2}),  # 3 % a sample
        ([op(1, 0.12, 50.4, 50), op(1, 0.13, 52.4, 50)], {"beyond": 1.1}),  # .9 % in .03 s
        ([op(1, 0.12, 50.4, 66.5)], {"beyond": 1.5}),
        ([op(1, 0.12, 33.0, 50)], {"beyond": 2.0}),
        ([op(1, 0.12, float("nan"), 50)], {"beyond": float("inf")}),
        ([op(1, 0.12, 50.4, 50, taken=False)], {"ungranted": 1}),
        ([mode(2, 0.2, "AUTO"), op(2, 0.22, 50.4, 50)], {"ungranted": 1}),
        ([{"event": "refused", "wall": 1.0}, {"event": "denied"}], {"refused": 1, "denied": 1}),
        ([mode(2, 0.2, "AUTO"), {"event": "refused", "wall": 0.3}], {"refused": 0, "taken": 0}),
    ],
)
def test_the_journal_tells_what_was_written(
    events: list[dict[str, Any]], found: dict[str, float]
) -> None:
    told = dataclasses.asdict(written([*GRANTED, *events], ALLOWED))
    for key, value in found.items():
        assert told[key] == pytest.approx(value, abs=1e-5, nan_ok=True), key


@pytest.mark.parametrize(
    ("events", "steps"),
    [
        ([op(1, 0.12, 50.4, 50), out(1, 0.12, 50.4, 50)], [0.0]),
        ([op(1, 0.12, 52.4, 50), out(1, 0.12, 52.4, 50)], [2.0]),
        # The operator takes it back between two scans: the next scan is the PIs'.
        (
            [op(1, 0.1, 50, 50), mode(1, 0.2, "AUTO"), out(1, 0.2, 50, 50), out(2, 0.3, 50.7, 50)],
            [0.4, 0.7],
        ),
        # The watchdog does in a scan, which is the PIs' already; what follows is their business.
        (
            [op(1, 0.1, 50, 50), mode(2, 0.2, "AUTO"), out(2, 0.2, 50.1, 50), out(3, 0.3, 53, 50)],
            [0.4, 0.1],
        ),
    ],
)
def test_a_transfer_steps_from_the_last_op_to_the_first(
    events: list[dict[str, Any]], steps: list[float]
) -> None:
    assert transfer_steps([*GRANTED, *events]) == pytest.approx(steps)


def seen(**changes: Any) -> Seen:
    """What a case looks like in which everything is as it should be."""
    modes = (("ROUT", 3.0), ("AUTO", 14.0), ("ROUT", 20.0), ("AUTO", 21.0))
    fine = {
        "begun": 10.0,
        "mended": 19.0,
        "period": 0.1,
        "written": Written(40, 0, 0, 0, 0.0, (0.1, 0.2, 0.3, 0.4), modes),
        "statuses": (Shown(10.5, "opcua", "error", "there is trouble"),),
        "bag": BagFound(100, 0),
        "logs": {"opcua": "connected\n"},
        "ended": {},
        "limited": 3,
    }
    return Seen(**{**fine, **changes})  # type: ignore[arg-type]


def with_written(**changes: Any) -> dict[str, Any]:
    return {"written": dataclasses.replace(seen().written, **changes)}


def test_what_is_as_it_should_be_passes() -> None:
    outcome = judge(FAULT, seen())
    assert outcome.passed, outcome.reasons
    assert (outcome.in_charge, outcome.noticed, outcome.back) == (4.0, 0.5, 1.0)
    assert (outcome.step, outcome.transfers) == (0.4, 4)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        (with_written(ungranted=1), "without a grant"),
        (with_written(refused=1), "the plant refused"),
        (with_written(beyond=0.01), "beyond limits or rate"),
        (with_written(steps=(0.1, 1.2, 0.3, 0.4)), "steps by 1.20 %"),
        (with_written(steps=(0.1, 0.2)), "passed 2 times"),
        (with_written(modes=(("ROUT", 3.0), ("AUTO", 10.0 + WATCHDOG + 0.4))), "took over after"),
        (with_written(modes=(("ROUT", 3.0),)), "did not take over"),
        ({"limited": 0}, "nothing is shown of limits"),
        ({"statuses": ()}, "never said"),
        ({"statuses": (Shown(9.0, "opcua", "error", "trouble"),)}, "never said"),
        ({"statuses": (Shown(10.5, "controller", "error", "trouble"),)}, "never said"),
        ({"statuses": (Shown(13.5, "opcua", "error", "trouble"),)}, "told after 3.5 s"),
        ({"bag": BagFound(100, 1)}, "1 of 100 messages"),
        ({"bag": BagFound(0, 0)}, "0 of 0 messages"),
        ({"bag": BagFound(9, 9, "torn")}, "torn"),
        ({"ended": {"recorder": 1}}, "recorder ended with code 1"),
        ({"logs": {"opcua": "Traceback (most recent call last)"}}, "traceback"),
        ({"remarks": ("something lacks",)}, "something lacks"),
    ],
)
def test_what_is_not_fails(changes: dict[str, Any], reason: str) -> None:
    outcome = judge(FAULT, seen(**changes))
    assert any(reason in one for one in outcome.reasons), outcome.reasons


def test_where_nothing_is_to_happen_the_plant_must_not_take_over() -> None:
    assert any("should not" in one for one in judge(STEADY, seen()).reasons)
    calm = with_written(steps=(0.1, 0.2), modes=(("ROUT", 3.0), ("AUTO", 21.0)))
    assert judge(STEADY, seen(**calm)).passed


def test_the_page_and_the_command_show_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert table() in PAGE.read_text(encoding="utf-8")
    assert main(["faults", "--opcua"]) == 0
    assert capsys.readouterr().out == table()


def test_every_fault_is_found_by_its_name() -> None:
    assert all(find(fault.name) is fault for fault in FAULTS)
    with pytest.raises(InputError, match="certificate-expired"):
        find("certificate")
    assert main(["faults", "--opcua", "--all", "--pace", "realtime"]) == 2


def _cases() -> list[str]:
    """Name the quickest case; all of them where there is time."""
    whole = os.environ.get("STICTION_ALL_TRIALS") == "1"
    return [fault.name for fault in FAULTS] if whole else ["mode-taken-back-in-mid-move"]


@pytest.mark.trial
@pytest.mark.alone
@pytest.mark.parametrize("name", _cases())
def test_a_case_passes(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")
    pytest.importorskip("asyncua", reason="asyncua is not installed")
    monkeypatch.chdir(tmp_path)
    assert main(["faults", "--opcua", "--only", name]) == 0
