"""The report of an example."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.identification import Identification, IdentificationOptions, identify
from stiction_studies.examples import Example, compare, example1, example2, healthy_loop
from stiction_studies.pages.example_report import report_example, trends, window

FAST = IdentificationOptions(output_order=1, input_order=1, delay=(0, 0))


@pytest.fixture(scope="module")
def tank() -> Example:
    return example2(1, "tank", 620)


@pytest.fixture(scope="module")
def found(tank: Example) -> Identification:
    return identify(tank.record, FAST)


@pytest.mark.trial
def test_the_page_stands_alone(tank: Example, found: Identification, tmp_path: Path) -> None:
    target = tmp_path / "report.html"
    assert report_example(tank, found, compare(tank, found), target) == target
    page = target.read_text(encoding="utf-8")
    links = re.findall(r"""(?:src|href)\s*=\s*["']([^"']+)""", page)
    assert all(link.startswith("data:") for link in links)
    assert "Example 2" in page
    assert "the nonlinear tank (A.1), seed 1" in page
    assert "Stem error (1/m)" in page
    assert "true 8" in page
    assert page.count("simulated process") == 2
    assert page.count("</i>stem, true") == 4


@pytest.mark.trial
def test_a_truth_outside_its_interval_stands_out(
    tank: Example, found: Identification, tmp_path: Path
) -> None:
    valve = dataclasses.replace(found.valves[0], static_interval=(8.5, 9.0))
    wrong = dataclasses.replace(found, valves=(valve, found.valves[1]))
    page = report_example(tank, wrong, compare(tank, wrong), tmp_path / "p.html")
    assert '<td class="bad">8.500 … 9.000</td>' in page.read_text(encoding="utf-8")


@pytest.mark.trial
def test_trends_show_measured_and_estimated_signals(tank: Example, found: Identification) -> None:
    figures = trends(tank, found)
    assert figures.count("<figure") == len(tank.record.outputs) + len(tank.record.valves)
    for label in ("PV, measured", "one-step estimate", "free run", "stem, true"):
        assert figures.count(f"</i>{label}") == 2


@pytest.mark.trial
def test_the_window_holds_a_set_point_move() -> None:
    for example in (example1(1), example2(1)):
        part = window(example)
        assert part.stop - part.start == len(example.record) // 5
        assert example.record.sp is not None
        assert np.ptp(example.record.sp[part], axis=0).max() > 0.0


def test_a_record_without_moves_has_a_window_too() -> None:
    example = healthy_loop(3, "sine")
    part = window(example)
    assert 0 <= part.start < part.stop <= len(example.record)
