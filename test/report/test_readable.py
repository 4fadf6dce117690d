"""Reports in a browser: on a screen and on a phone, in light and dark."""

from pathlib import Path

import pytest
from browser import check, needs_browser, probe
from made import identification, record

from stiction_ros.config_files import find_config
from stiction_ros.discrepancy import GapOptions, find_discrepancy
from stiction_ros.effects import from_mapping
from stiction_ros.loop import LoopModel, SetPoints, simulate
from stiction_ros.records.run.log import RunLog
from stiction_ros.report.gap_page import report_gap
from stiction_ros.report.record_page import report_record
from stiction_ros.report.run.report import report_run
from stiction_ros.report.run.story import tell

LOOKS = [
    pytest.param(390, True, id="phone-dark"),
    pytest.param(390, False, id="phone-light", marks=pytest.mark.trial),
    pytest.param(1400, True, id="screen-dark", marks=pytest.mark.trial),
    pytest.param(1400, False, id="screen-light", marks=pytest.mark.trial),
]


@pytest.mark.parametrize(("width", "dark"), LOOKS)
@needs_browser
def test_the_report_of_a_record_is_readable(tmp_path: Path, width: int, dark: bool) -> None:
    of = record()
    page = report_record(of, identification(of), tmp_path / "report.html")
    check(probe(page, width, dark=dark), width, dark=dark)


@pytest.mark.parametrize(("width", "dark"), LOOKS)
@pytest.mark.trial
@needs_browser
def test_the_report_of_a_run_is_readable(
    log: RunLog, tmp_path: Path, width: int, dark: bool
) -> None:
    page = report_run(tell(log), tmp_path / "report.html")[0]
    check(probe(page, width, dark=dark), width, dark=dark)


@pytest.fixture(scope="module")
def gap_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    model = LoopModel.load(find_config("flow.loop.yaml")).with_ideal_valves()
    schedule = SetPoints.load(find_config("flow.set_points.yaml"), model.outputs)
    hidden = from_mapping({"effect": "stiction", "law": "he", "f_s": 4.0, "f_d": 1.5})
    record = simulate(model.with_effect("valve:V1", hidden), schedule, samples=800)
    found = find_discrepancy(model, [record], GapOptions(quick=True))
    return report_gap(found, tmp_path_factory.mktemp("gap"))


@pytest.mark.parametrize(("width", "dark"), LOOKS)
@pytest.mark.trial
@needs_browser
def test_the_page_of_a_gap_is_readable(gap_page: Path, width: int, dark: bool) -> None:
    check(probe(gap_page, width, dark=dark), width, dark=dark)
