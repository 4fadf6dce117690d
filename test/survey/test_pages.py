import dataclasses
from pathlib import Path
from typing import Any

import pytest
from browser import check, needs_browser, probe
from made import GAIN, entry, identification, record

from stiction_ros.pages.signals import Units
from stiction_ros.survey.entry import Entry, Status
from stiction_ros.survey.groups import Group
from stiction_ros.survey.listing.headline import Earlier, in_words
from stiction_ros.survey.listing.page import list_page
from stiction_ros.survey.pages.loop_page import loop_page
from stiction_ros.survey.survey import Survey

EARLIER = (
    Earlier("2023-11-02 03:04+00:00", {"FIC-101.A": 1.0, "OLD1": None}),
    Earlier("2023-12-02 03:04+00:00", {"FIC-101.A": 2.0, "LIC7": 0.5, "OLD2": 2.0}),
)

COLUMNS = {"now": GAIN["now"], **{option["what"]: option for option in GAIN["options"]}}

WIDE, NARROW = 1400, 390  # px
both_ways = pytest.mark.parametrize(
    ("width", "dark"),
    [
        (WIDE, False),
        (NARROW, True),
        pytest.param(WIDE, True, marks=pytest.mark.trial),
        pytest.param(NARROW, False, marks=pytest.mark.trial),
    ],
)


def _survey() -> Survey:
    rows = [
        entry("FIC-101.A", gain=COLUMNS, rank=1, group=1, cost_per_hour=12.5, probability=0.6),
        entry("A_VERY_LONG_TAG_OF_A_REFINERY:2411PDIC10321_0606_0007", rank=2, group=1),
        entry("LIC7", "undecided", "disturbance", probability=0.3, rank=3),
        entry("<b>TIC</b>", "healthy", "none", oscillation=None, probability=0.95, rank=4),
        Entry("XIC", ("x.csv",), Status.FAILED, "its stamps are <wrong>; say --dates day", rank=5),
    ]
    rows[0] = dataclasses.replace(rows[0], report="loops/FIC-101.A.html")
    groups = (Group(1, 61.0, ("FIC-101.A", rows[1].name)),)
    return Survey("local", 2, 12.0, tuple(rows), groups, "2024-01-02 03:04+00:00")


@pytest.fixture
def list_file(tmp_path: Path) -> Path:
    page = tmp_path / "survey.html"
    page.write_text(list_page(_survey(), EARLIER), encoding="utf-8")
    return page


@pytest.fixture
def loop_file(tmp_path: Path) -> Path:
    of = record()
    row = dataclasses.replace(entry("FIC-101.A"), notes=("3 values were held",))
    page = tmp_path / "loop.html"
    html = loop_page(row, of, identification(of), GAIN, "m³/h")
    page.write_text(html, encoding="utf-8")
    return page


@needs_browser
@both_ways
def test_the_list_is_readable(list_file: Path, width: int, dark: bool) -> None:
    seen = probe(list_file, width, dark=dark)
    check(seen, width, dark)
    for words in ("2 valves to look at", "<b>TIC</b>", "its stamps are <wrong>", "likely source"):
        assert words in seen["text"]


@needs_browser
@pytest.mark.parametrize("width", [NARROW, pytest.param(WIDE, marks=pytest.mark.trial)])
def test_a_list_with_all_columns_and_the_longest_words_is_readable(
    tmp_path: Path, width: int
) -> None:
    said = {
        "service": "The drawn loops do not agree on its amplitude.",
        "embedding": "Nothing is promised of embedding it.",
        "retune": "Neither valve nor tuning is the cause: another tuning is not looked for.",
    }
    gain = {"now": {"iae_per_hour": 2.0}}
    gain |= {what: {"iae_per_hour": None, "note": note} for what, note in said.items()}
    rest = {"gain": gain, "cost_per_hour": 11.25, "group": 12, "op_unit": "its own unit"}
    small = {"f_s": 0.0489123, "f_d": 0.0246123, "band_share": 0.64}
    rows = tuple(
        entry(f"AIC-{k}.A", "backlash", "set_point", rank=k, **rest, **small)
        for k in range(100, 104)
    )
    earlier = (Earlier("2023-11-02 03:04+00:00", {row.name: 0.0735123 for row in rows}),)
    page = tmp_path / "survey.html"
    page.write_text(list_page(Survey("local", 2, 12.0, rows, ()), earlier), encoding="utf-8")
    check(probe(page, width, dark=False), width, dark=False)


@needs_browser
@both_ways
def test_the_page_of_a_loop_is_readable(loop_file: Path, width: int, dark: bool) -> None:
    seen = probe(loop_file, width, dark=dark)
    check(seen, width, dark)
    for words in ("Valve V1 sticks", "3 values were held", "m³/h", "a service of the valve"):
        assert words in seen["text"]


@needs_browser
def test_the_list_sorts_filters_and_searches(list_file: Path) -> None:
    act = """
      const names = () => [...document.querySelectorAll("table.list tbody tr")]
        .filter(row => !row.hidden).map(row => row.querySelector(".name").innerText);
      const head = [...document.querySelectorAll("th button")]
        .find(one => one.innerText.startsWith("probability"));
      const box = head.getBoundingClientRect();
      head.click(); const down = names(); head.click(); const up = names();
      const put = (id, value) => { const input = document.getElementById(id);
        input.value = value; input.dispatchEvent(new Event("input")); };
      put("kind", "healthy"); const healthy = names(); put("kind", "");
      put("search", "wrong xic"); const searched = names(); put("search", "");
      const seen = box.right <= innerWidth && box.width;
      return { up, down, healthy, searched, all: names().length, seen };
    """
    acted = probe(list_file, NARROW, dark=False, act=act)["acted"]
    assert acted["seen"] > 20
    assert acted["up"][0] == "LIC7"
    assert acted["down"][0] == "<b>TIC</b>"
    assert acted["up"][-1] == acted["down"][-1] == "XIC"
    assert acted["healthy"] == ["<b>TIC</b>"]
    assert acted["searched"] == ["XIC"]
    assert acted["all"] == 5


@needs_browser
def test_figures_of_one_time_are_zoomed_together_and_come_back(loop_file: Path) -> None:
    act = """
      const figures = [...document.querySelectorAll("figure.plot[data-low]")]
        .filter(one => +one.dataset.low === 0);
      const boxes = () => figures.map(one => one.querySelector("svg svg").getAttribute("viewBox"));
      const svg = figures[0].querySelector("svg");
      const box = svg.querySelector("svg").getBoundingClientRect();
      const at = (kind, share) => svg.dispatchEvent(new PointerEvent(kind, { bubbles: true,
        clientX: box.left + share * box.width, clientY: box.top + box.height / 2 }));
      const before = boxes();
      at("pointerdown", 0.4); at("pointerup", 0.6);
      const zoomed = boxes();
      const ticks = [...svg.querySelectorAll("g.x text")].map(tick => parseFloat(tick.textContent));
      const bar = figures[0].previousElementSibling;
      const press = name => [...bar.children].find(one => one.textContent === name).click();
      const shown = !bar.lastChild.disabled;
      press("all"); const back = boxes();
      press("closer"); const closer = boxes()[1]; press("later"); const later = boxes()[1];
      return { before, zoomed, ticks, shown, back, closer, later };
    """
    acted = probe(loop_file, 1400, dark=False, act=act)["acted"]
    wide = float(acted["before"][0].split()[2])
    assert float(acted["zoomed"][0].split()[2]) == pytest.approx(0.2 * wide, rel=0.02)
    assert acted["zoomed"][1] == acted["zoomed"][0]  # OP goes with PV
    assert acted["back"] == acted["before"]
    assert acted["shown"]
    assert len(acted["ticks"]) >= 2
    assert all(6.0 < tick < 14.0 for tick in acted["ticks"])
    x, width = (float(acted["closer"].split()[k]) for k in (0, 2))
    assert (x / wide, width / wide) == pytest.approx((0.25, 0.5))
    assert float(acted["later"].split()[0]) == pytest.approx(0.5 * wide)


def test_pages_hold_all_they_show(list_file: Path, loop_file: Path) -> None:
    for page in (list_file, loop_file):
        source = page.read_text(encoding="utf-8")
        for word in ("http:", "https:", " src=", "@import", "url("):
            assert word not in source.replace("http://www.w3.org/2000/svg", "")


def test_tags_and_reasons_are_no_html(list_file: Path) -> None:
    source = list_file.read_text(encoding="utf-8")
    assert "<b>TIC" not in source
    assert "&lt;b&gt;TIC" in source


def test_trends_have_figures_and_one_scale(list_file: Path) -> None:
    source = list_file.read_text(encoding="utf-8")
    assert "1 → 3 %" in source
    assert 'title="2023-11-02: 1, 2023-12-02: 2, now: 3"' in source
    heights = [part.split('"')[0].split(",")[-1] for part in source.split('<polyline points="')[1:]]
    assert heights == ["2.0", "2.0"]  # both are as wide as the widest
    assert "Gone since the survey of 2023-12-02: OLD2." in source
    assert "New since the survey of 2023-12-02: &lt;b&gt;TIC&lt;/b&gt;, A_VERY" in source


def test_the_list_says_what_is_saved_or_why_nothing_is(tmp_path: Path) -> None:
    def gain(iae: float | None, note: str) -> dict[str, Any]:
        return {"now": {"iae_per_hour": 2.0}, "service": {"iae_per_hour": iae, "note": note}}

    disagree = "Simulated. The drawn loops do not agree on what it would bring."
    repeat = "Not simulated: no more than 3 of 20 drawn loops repeat the record."
    rest = {
        "now": {"iae_per_hour": 2.0},
        "retune": {"iae_per_hour": 2.0, "note": "No other tuning"},
    }
    rows = [
        (gain(0.5, ""), "service", "−75 %"),
        (gain(2.06, ""), "service", "+3 %"),
        (gain(None, disagree), "service", "draws disagree"),
        (gain(None, repeat), "service", "does not repeat"),
        (gain(None, "In 2 of them the loop grows without end."), "service", "unstable"),
        (gain(None, "It would answer 4 times as fast."), "service", "faster than shown"),
        (None, "service", "not simulated"),
        (rest, "retune", "none helps"),
    ]
    for given, what, said in rows:
        assert in_words(entry("A", gain=given), what) == said
    assert in_words(entry("A", "healthy"), "service") == ""
    page = list_page(Survey("local", 1, 1.0, (entry("A", gain=rows[2][0]),), ()))
    assert f'title="{disagree}">draws disagree' in page
    page_of = list_page(Survey("local", 1, 1.0, (entry("A", gain=rows[0][0]),), ()))
    assert "−75&nbsp;%" in page_of  # a figure and its unit are not parted on a phone
    assert "simulated: −75 % leaves a quarter" in page


def test_every_heading_says_what_it_means(list_file: Path) -> None:
    source = list_file.read_text(encoding="utf-8")
    assert '<button type="button">' not in source.partition("</thead>")[0]
    assert source.count("<dt>") == source.count('<button type="button" title="')


def test_causes_have_one_wording(list_file: Path) -> None:
    source = list_file.read_text(encoding="utf-8")
    assert '<option value="disturbance">a wave from outside</option>' in source
    assert ">a wave from outside</td>" in source
    assert ">disturbance<" not in source


def test_a_survey_in_which_nothing_was_judged_says_so() -> None:
    failed = [Entry(name, (), Status.FAILED, "no") for name in "ABC"]
    assert "<h1>3 of 3 could not be judged" in list_page(Survey("l", 1, 1.0, tuple(failed), ()))
    some = Survey("l", 1, 1.0, (*failed, entry("D", "healthy")), ())
    assert "<h1>No valve found among 4 loops; 3 could not be judged" in list_page(some)


def test_an_op_in_its_own_unit_is_no_percent() -> None:
    row = entry("A", op_unit="its own unit")
    assert ">2 units</span>" in list_page(Survey("l", 1, 1.0, (row,), ()))
    of = record()
    page = loop_page(row, of, identification(of), None)
    assert "has gone back by 3.00 units" in page
    assert "takes 50 % of OP" in page
    assert "OP of V1, OP&#x27;s own unit" in page
    assert Units("bar").said("2 %, 5 % of OP, 1 PV units") == "2 %, 5 % of OP, 1 bar"
    assert Units("bar", "OP").said("2 %, 5 % of OP, 3 % of travel") == "2 units, 5 % of OP, 3 units"


def test_the_page_of_a_loop_says_why_and_what_next(loop_file: Path) -> None:
    source = loop_file.read_text(encoding="utf-8")
    assert "rests until OP has gone back by 3.00 %, and then jumps by 1.00 % or more." in source
    assert "next:</b> Have V1 serviced (packing and positioner first), unless <code>" in source
    assert "imulated" not in source.partition("<table")[0]  # what was not stands in the table


def test_the_unit_of_pv_stands_on_the_page(loop_file: Path) -> None:
    of = record()
    assert "PV units" in loop_page(entry("FIC-101.A"), of, identification(of), GAIN)
    told = loop_file.read_text(encoding="utf-8")
    assert "m³/h" in told
    assert "PV units" not in told


def test_an_empty_survey_says_so() -> None:
    page = list_page(Survey("local", 1, 0.1, (), ()))
    assert "There is no loop in what was given." in page
