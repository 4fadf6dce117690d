"""Reports in a browser, on a phone in the dark."""

from __future__ import annotations

from pathlib import Path

from browser import check, needs_browser, probe
from made import identification, record

from stiction_ros.records.run.log import RunLog
from stiction_ros.report.record.report import report_record
from stiction_ros.report.run.report import write_run
from stiction_ros.report.run.story import tell


@needs_browser
def test_the_report_of_a_record_is_readable(tmp_path: Path) -> None:
    of = record()
    page = report_record(of, identification(of), tmp_path / "report.html")
    check(probe(page, 390, dark=True), 390, dark=True)


@needs_browser
def test_the_report_of_a_run_is_readable(log: RunLog, tmp_path: Path) -> None:
    page = write_run(tell(log), tmp_path / "report.html").page
    check(probe(page, 390, dark=True), 390, dark=True)
