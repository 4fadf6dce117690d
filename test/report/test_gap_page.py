"""The page of a discrepancy, for someone who has not read the paper."""

import re
from pathlib import Path

import pytest

from stiction_ros.config_files import find_config
from stiction_ros.discrepancy import Discrepancy, FoundEffect, GapOptions, find_discrepancy
from stiction_ros.effects import HeStiction, from_mapping
from stiction_ros.loop import LoopModel, SetPoints, simulate
from stiction_ros.report.gap_page import report_gap
from stiction_ros.report.gap_words import figures_with_units


def discrepancy(place: str, **effect: object) -> Discrepancy:
    model = LoopModel.load(find_config("flow.loop.yaml")).with_ideal_valves()
    schedule = SetPoints.load(find_config("flow.set_points.yaml"), model.outputs)
    record = simulate(model.with_effect(place, from_mapping(effect)), schedule, samples=800)
    return find_discrepancy(model, [record], GapOptions(quick=True))


@pytest.fixture(scope="module")
def lagging() -> Discrepancy:
    return discrepancy("process:PV1", effect="pole", tau=6.0)


@pytest.fixture(scope="module")
def page(lagging: Discrepancy, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return report_gap(lagging, tmp_path_factory.mktemp("gap"))


@pytest.fixture(scope="module")
def said(page: Path) -> str:
    """The words of the page that are not folded away."""
    body = re.sub(r"<details>.*?</details>", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.sub(r"<style>.*?</style>|<[^>]*>", " ", body, flags=re.DOTALL)


def test_every_figure_has_a_name_and_a_unit(said: str, lagging: Discrepancy) -> None:
    for effect in lagging.effects:
        for key in effect.parameters:
            assert re.search(rf"{key} = [-\d.e]+ s, 95 % between", said)


def test_a_figure_has_the_digits_that_its_interval_tells() -> None:
    effect = FoundEffect(
        "valve:V1",
        HeStiction(5.8874, 3.5),
        1470.0,
        {"f_s": (5.868, 5.8929), "f_d": (1.0, 4.0)},
        closed=1.0,
    )
    static, dynamic = figures_with_units(effect)
    assert "5.887 %, 95 % between 5.868 and 5.893" in static
    assert "3.50 %, 95 % between 1 and 4" in dynamic


def test_no_internal_words(said: str) -> None:
    for word in ("not_asked", "bias_step", "time_shift", "valve:V1", "process:PV1"):
        assert word not in said


def test_it_shows_what_would_decide(said: str, page: Path) -> None:
    assert "What would decide" in said
    assert page.read_text(encoding="utf-8").count("<figure") > 2
    assert [path.name for path in page.parent.iterdir()] == [page.name]


def test_an_effect_is_listed_once_in_each_look(page: Path) -> None:
    assert page.name == "report.html"
    for look in page.read_text(encoding="utf-8").split("the candidates</h2>")[1:]:
        names = re.findall(r'<tr><td class="t">([^<]*)</td>', look.split("</table>")[0])
        assert len(names) > 5
        assert len(set(names)) == len(names)
