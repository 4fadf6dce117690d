from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import chromium, probe
from made import GAIN, entry, identification, record

from stiction_ros.survey.entry import Entry, Status
from stiction_ros.survey.groups import Group
from stiction_ros.survey.listing.page import list_page
from stiction_ros.survey.pages.loop_page import loop_page, with_trend
from stiction_ros.survey.pages.plot import MOST, Curve, over_time
from stiction_ros.survey.survey import Survey

needs_browser = pytest.mark.skipif(chromium() is None, reason="no Chromium is installed")

COLUMNS = {"now": GAIN["now"], **{option["what"]: option for option in GAIN["options"]}}


def _survey() -> Survey:
    rows = [
        entry("FIC-101.A", gain=COLUMNS, rank=1, group=1, cost_per_hour=12.5, confidence=0.6),
        entry("A_VERY_LONG_TAG_OF_A_REFINERY:2411PDIC10321_0606_0007", rank=2, group=1),
        entry("LIC7", "undecided", "disturbance", confidence=0.3, rank=3),
        entry("<b>TIC</b>", "healthy", "none", oscillation=None, confidence=0.95, rank=4),
        Entry("XIC", ("x.csv",), Status.FAILED, "its stamps are <wrong>; say --dates day", rank=5),
    ]
    rows[0] = dataclasses.replace(rows[0], report="loops/FIC-101.A.html")
    groups = (Group(1, 61.0, ("FIC-101.A", rows[1].name)),)
    return Survey("local", 2, 12.0, tuple(rows), groups, "2024-01-02 03:04+00:00")


@pytest.fixture
def list_file(tmp_path: Path) -> Path:
    page = tmp_path / "survey.html"
    page.write_text(list_page(_survey(), {"FIC-101.A": [1.0, 2.0]}), encoding="utf-8")
    return page


@pytest.fixture
def loop_file(tmp_path: Path) -> Path:
    of = record()
    row = dataclasses.replace(entry("FIC-101.A"), notes=("3 values were held",))
    page = tmp_path / "loop.html"
    html = loop_page(row, of, identification(of), GAIN, "m³/h")
    page.write_text(html, encoding="utf-8")
    return page


def _check(seen: dict[str, Any], width: int, dark: bool) -> None:
    assert seen["width"] == width
    assert seen["dark"] is dark
    assert (seen["paper"] < 0.2) is dark
    assert seen["scroll"] <= width, seen["wide"]
    assert seen["wide"] == []
    assert seen["said"] == []
    assert seen["empty"] == 0
    assert seen["pale"] == []
    assert seen["fetched"] == []


@needs_browser
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [1400, 390])
def test_the_list_is_readable(list_file: Path, width: int, dark: bool) -> None:
    seen = probe(list_file, width, dark=dark)
    _check(seen, width, dark)
    for words in ("2 valves to look at", "<b>TIC</b>", "its stamps are <wrong>", "likely source"):
        assert words in seen["text"]


@needs_browser
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [1400, 390])
def test_the_page_of_a_loop_is_readable(loop_file: Path, width: int, dark: bool) -> None:
    seen = probe(loop_file, width, dark=dark)
    _check(seen, width, dark)
    for words in ("The valve sticks", "3 values were held", "m³/h", "service the valve"):
        assert words in seen["text"]


@needs_browser
def test_the_list_sorts_filters_and_searches(list_file: Path) -> None:
    act = """
      const names = () => [...document.querySelectorAll("table.list tbody tr")]
        .filter(row => !row.hidden).map(row => row.querySelector("td.name").innerText);
      const head = [...document.querySelectorAll("th button")]
        .find(one => one.innerText.startsWith("confidence"));
      head.click(); const up = names(); head.click(); const down = names();
      const put = (id, value) => { const input = document.getElementById(id);
        input.value = value; input.dispatchEvent(new Event("input")); };
      put("kind", "healthy"); const healthy = names(); put("kind", "");
      put("search", "wrong xic"); const searched = names(); put("search", "");
      return { up, down, healthy, searched, all: names().length };
    """
    acted = probe(list_file, 1400, dark=False, act=act)["acted"]
    assert acted["up"][0] == "LIC7"
    assert acted["down"][0] == "<b>TIC</b>"
    assert acted["up"][-1] == acted["down"][-1] == "XIC"
    assert acted["healthy"] == ["<b>TIC</b>"]
    assert acted["searched"] == ["XIC"]
    assert acted["all"] == 5


@needs_browser
def test_a_figure_is_zoomed_by_dragging_and_comes_back(loop_file: Path) -> None:
    act = """
      const figure = document.querySelector("figure.plot[data-low]");
      const svg = figure.querySelector("svg"), area = svg.querySelector("svg");
      const box = svg.getBoundingClientRect(), y = box.top + box.height / 2;
      const at = (kind, share) => svg.dispatchEvent(new PointerEvent(kind,
        { clientX: box.left + share * box.width, clientY: y, bubbles: true }));
      const before = area.getAttribute("viewBox");
      at("pointerdown", 0.4); at("pointerup", 0.6);
      const zoomed = area.getAttribute("viewBox").split(" ").map(Number);
      const ticks = [...svg.querySelectorAll("g.x text")].map(tick => +tick.textContent);
      const shown = !figure.querySelector("button").hidden;
      figure.querySelector("button").click();
      return { wide: +before.split(" ")[2], zoomed, ticks, shown,
        back: area.getAttribute("viewBox").split(" ").map(Number)[2] };
    """
    acted = probe(loop_file, 1400, dark=False, act=act)["acted"]
    assert acted["zoomed"][2] == pytest.approx(0.2 * 960 / 880 * acted["wide"], rel=0.02)
    assert acted["back"] == pytest.approx(acted["wide"])
    assert acted["shown"]
    assert len(acted["ticks"]) >= 2
    assert all(6.0 < tick < 14.0 for tick in acted["ticks"])


def test_pages_hold_all_they_show(list_file: Path, loop_file: Path) -> None:
    for page in (list_file, loop_file):
        source = page.read_text(encoding="utf-8")
        for word in ("http:", "https:", " src=", "@import", "url("):
            assert word not in source.replace("http://www.w3.org/2000/svg", "")


def test_tags_and_reasons_are_no_html(list_file: Path) -> None:
    source = list_file.read_text(encoding="utf-8")
    assert "<b>TIC" not in source
    assert "&lt;b&gt;TIC" in source


def test_a_long_curve_keeps_its_peaks_and_its_gaps() -> None:
    values = np.zeros(50_000)
    values[31_234] = 7.0
    values[100:200] = np.nan
    figure = over_time("t", np.arange(50_000.0), "s", [Curve("PV", "pv", values)], "PV")
    lines = [part.split('"')[0] for part in figure.split('points="')[1:]]
    assert len(lines) == 2
    points = [tuple(map(float, pair.split(","))) for line in lines for pair in line.split()]
    assert len(points) <= 1.2 * MOST
    assert min(y for _, y in points) < 0.1 * max(y for _, y in points)


def test_a_trend_is_put_into_the_page_once(loop_file: Path) -> None:
    page = loop_file.read_text(encoding="utf-8")
    once = with_trend(page, [1.0, 2.0])
    assert "Band f_S + f_D: 1, 2" in once
    twice = with_trend(once, [1.0, 2.0, 3.5])
    assert "Band f_S + f_D: 1, 2, 3.5" in twice
    assert twice.count("Earlier surveys") == 1
    assert twice.endswith(page[-2000:])


def test_an_empty_survey_says_so() -> None:
    page = list_page(Survey("local", 1, 0.1, (), ()))
    assert "There is no loop in what was given." in page
