import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.identification import FitStatus, Identification, OutputModel, ValveEstimate
from stiction_ros.identification.result import VerdictKind
from stiction_ros.loop import LoopModel
from stiction_ros.pages.frame import words
from stiction_ros.records.run.log import RunLog
from stiction_ros.report.page import interval, number
from stiction_ros.report.record_page import report_record
from stiction_ros.report.run.identified import (
    step_response,
    true_response,
    valve_cards,
    verdict_line,
)
from stiction_ros.report.run.report import headline, report_run
from stiction_ros.report.run.story import tell

FIGURES = (
    "The end of the limit cycle",
    "The whole run",
    "Friction found over time",
    "Response to a step of the stem",
)


def outside(page: str) -> list[str]:
    """Return everything in a page that a browser would fetch."""
    links = re.findall(r"""(?:src|href)\s*=\s*["']([^"']+)|url\(([^)]+)\)""", page)
    return [a or b for a, b in links if not (a or b).startswith("data:")]


def test_the_report_of_a_run(log: RunLog, tmp_path: Path) -> None:
    file, figures = report_run(tell(log), tmp_path / "new" / "folder")
    page = file.read_text(encoding="utf-8")
    assert outside(page) == []
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "")
    assert "Valve V1 sticks; the swap ended the limit cycle" in page
    assert "After 500 s the controller changed from unaware to embedding" in page
    assert "5.10 % (4.98\u00a0…\u00a05.22)" in page
    for key in ("amplitude", "offset", "iae_per_hour"):
        assert number(figures["phases"]["before"]["PV1"][key]) in page
    assert "a note &lt;of&gt; the reader" in page
    assert "f_s: 5.0" in page
    assert sorted(path.name for path in file.parent.iterdir()) == ["report.html", "summary.json"]
    for title in FIGURES:
        assert f"<h2>{title}</h2>" in page
    assert "The dashed line is the swap. Shaded: mode embedding." in page


@pytest.mark.trial
def test_one_page_alone(log: RunLog, tmp_path: Path) -> None:
    file, _ = report_run(tell(log), tmp_path / "only.html")
    assert [path.name for path in tmp_path.iterdir()] == ["only.html"]
    assert file.name == "only.html"


def test_healthy_valves_are_no_trouble(healthy: RunLog, tmp_path: Path) -> None:
    page = report_run(tell(healthy), tmp_path)[0].read_text(encoding="utf-8")
    assert "Valve V1 is healthy" in page
    assert 'class="warn"' not in page
    assert "The controller stayed unaware throughout." in page


def test_a_bag_with_nothing_but_the_signals(log: RunLog, tmp_path: Path) -> None:
    record = dataclasses.replace(log.record, sp=None, stem=None)
    bare = RunLog(record, log.start, (), (), (), {"/pv": 1200}, {})
    page = report_run(tell(bare), tmp_path)[0].read_text(encoding="utf-8")
    assert "No fit of the valves" in page
    assert [title for title in FIGURES if title in page] == ["The whole run"]


@pytest.mark.trial
def test_a_sticky_valve_without_a_comparison_is_a_warning(log: RunLog, tmp_path: Path) -> None:
    quiet = dataclasses.replace(log.record, pv=log.record.sp)
    page = report_run(tell(dataclasses.replace(log, record=quiet)), tmp_path)[0]
    assert "the loop did not cycle" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize("status", list(FitStatus))
def test_the_report_of_a_record(log: RunLog, tmp_path: Path, status: FitStatus) -> None:
    record = log.record
    evidence = {"delta_bic": float("inf"), "moves": 12.0}
    valve = ValveEstimate(
        "V1", VerdictKind.STICKY, "he", 5.0, (4.9, 5.1), 2.0, (1.9, 2.1), 3.0, 50.0, 12, evidence
    )
    output = OutputModel("PV1", (-0.9,), {"V1": (0.1,)}, {"V1": 2}, 5.0, 0.1, 90.0, 80.0)
    good = status is FitStatus.OK
    found = Identification(
        status,
        "" if good else "no model fits",
        "exact",
        len(record),
        1.0,
        0.1,
        (valve,),
        (output,) if good else (),
        record.stem if good else np.empty((0, 1)),
        ("a note",),
    )
    page = report_record(record, found, tmp_path / "out").read_text(encoding="utf-8")
    assert outside(page) == []
    assert "Valve V1 sticks" in page
    assert "5.00 % (4.90\u00a0…\u00a05.10)" in page
    assert ("no model fits" in page) is not good
    assert page.count("<figure") == (8 if good else 5)
    assert "<img" not in page


def test_step_responses_agree_with_the_loop_model(model: LoopModel) -> None:
    entry = {"name": "PV1", "a": [-0.9], "b": {"V1": [0.1]}, "delay": {"V1": 0}, "bias": 3.0}
    steps = step_response(entry, "V1", 60)
    assert steps == pytest.approx(true_response(model, 0, 0, 60))
    assert steps[:3] == pytest.approx([0.0, 0.1, 0.19])
    late = step_response({**entry, "delay": {"V1": 4}}, "V1", 60)
    assert late[4:] == pytest.approx(steps[:-4])


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.05163, "0.0516"),
        (123456.7, "123457"),
        (0, "0"),
        (14.0, "14"),
        (1.25, "1.25"),
        (-2.5e-7, "−2.50e−07"),
        (None, "–"),
        (float("nan"), "–"),
        (True, "–"),
    ],
)
def test_numbers_for_people(value: object, shown: str) -> None:
    assert number(value) == shown


def test_other_words_for_people() -> None:
    assert interval([1.0, None]) == "1.00\u00a0…\u00a0–"
    assert words("f_S < 1") == "f<sub>S</sub> &lt; 1"


@pytest.mark.parametrize(
    ("verdicts", "said"),
    [
        (["sticky"], "Valve V1 sticks"),
        (["backlash"], "Valve V1 has backlash"),
        (["sticky", "sticky"], "Valves V1 and V2 stick"),
        (["backlash", "backlash"], "Valves V1 and V2 have backlash"),
        (["backlash", "sticky"], "Valve V2 sticks, V1 has backlash"),
        (["backlash", "healthy"], "Valve V1 has backlash"),
        (["healthy", "undecided"], "No valve is shown to stick"),
        (["healthy"], "Valve V1 is healthy"),
        ([], "No fit of the valves"),
    ],
)
def test_the_verdicts_in_a_line(verdicts: list[str], said: str) -> None:
    valves = [{"name": f"V{n}", "verdict": verdict} for n, verdict in enumerate(verdicts, start=1)]
    assert verdict_line(valves) == said


def test_a_valve_with_backlash_is_shown_as_one_with_friction(log: RunLog) -> None:
    found = dict(log.fits[-1].identification)
    found["valves"] = [{**valve, "verdict": "backlash"} for valve in found["valves"]]
    told = dataclasses.replace(log.fits[-1], identification=found)
    story = tell(dataclasses.replace(log, fits=(*log.fits[:-1], told), modes=log.modes[:1]))
    assert story.identified["valves"][0]["verdict"] == "backlash"
    assert headline(story) == "Valve V1 has backlash; the controller was not swapped"
    assert 'class="card bad"' in valve_cards(story.identified["valves"])
