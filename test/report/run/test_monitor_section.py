import dataclasses
from pathlib import Path

import pytest

from stiction_ros.records.run.events import GapLog
from stiction_ros.records.run.log import RunLog
from stiction_ros.report.run.report import monitor_section, report_run
from stiction_ros.report.run.story import tell

SECOND = 10**9


def look(growth: float) -> dict[str, object]:
    output = {"gap": 0.25 * growth, "baseline": 0.25, "limit": 1.1}
    return {"grown": growth > 1.1, "failure": "", "outputs": {"PV1": output}}


def told(log: RunLog) -> RunLog:
    stamps = [log.start + n * SECOND for n in (499, 599)]
    looks = {stamps[0]: look(1.02), stamps[1]: look(2.5)}
    found = {stamps[1]: {"text": "PV1: sensor <bias_step>", "verdict": "named"}}
    return dataclasses.replace(log, gaps=GapLog(looks, found))


def test_a_run_without_monitor_has_no_such_part(log: RunLog) -> None:
    assert monitor_section(log) == ""


def test_every_measurement_is_told_with_what_was_found(log: RunLog) -> None:
    part = monitor_section(told(log))
    assert "measured 2 times; in 1 of them it had grown." in part
    assert "PV1 1.02 (1.10)" in part
    assert "PV1 2.50 (1.10)" in part
    assert "PV1: sensor &lt;bias_step&gt;" in part
    assert part.count("as in the baseline") == 1


@pytest.mark.trial
def test_the_report_of_a_run_holds_it(log: RunLog, tmp_path: Path) -> None:
    page = report_run(tell(told(log)), tmp_path / "run.html")[0].read_text(encoding="utf-8")
    assert "<h2>The monitor</h2>" in page
