"""Figures as SVG: their axes, and which curves they show."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from browser import needs_browser, probe
from made import identification, record

from stiction_ros.errors import InputError
from stiction_ros.pages.frame import framed
from stiction_ros.pages.plot import MOST, SCRIPT, Curve, over_time
from stiction_ros.pages.signals import Units, all_signals, close_look, plot

UNITS = Units("bar", "%")
MARCH = 1709330400.0
"""2024-03-01 22:00 UTC, s since 1970."""


AXES = [
    (90.0, 0.0, "0 s 20 40 60 80", "Time in seconds."),
    (4000.0, 0.0, "0 min 10 20 30 40 50 60", "Time in minutes."),
    (3600.0, MARCH, "1 Mar 22:00 22:10 22:20 22:30 22:40 22:50 23:00", "22:00 to 2024-03-01"),
    (3e4, MARCH, "1 Mar 22:00 2 Mar 02:00 04:00 06:00", "from 2024-03-01 22:00 to 2024-03-02"),
    (1e6, MARCH, "2 Mar 4 Mar 6 Mar 8 Mar 10 Mar 12 Mar", "to 2024-03-13 11:46:40."),
]


def _drawn(span: float, start: float) -> str:
    time = np.linspace(0.0, span, 50)
    return over_time("A figure.", time, [Curve("PV", "pv", time)], "PV", start)


def test_a_figure_over_time_says_its_dates_or_the_unit_of_its_time() -> None:
    for span, start, _, told in AXES:
        assert told in _drawn(span, start)


@needs_browser
def test_a_time_axis_bears_dates_where_the_record_has_them(tmp_path: Path) -> None:
    page = tmp_path / "axes.html"
    figures = [_drawn(span, start) for span, start, _, _ in AXES]
    page.write_text(framed("Axes", figures, SCRIPT), encoding="utf-8")
    act = """return [...document.querySelectorAll("g.x")].map(axis =>
      [...axis.querySelectorAll("text")].map(tick => tick.textContent).join(" "));"""
    shown = probe(page, 1400, dark=False, act=act)["acted"]
    assert shown == [marks for _, _, marks, _ in AXES]


def test_a_long_curve_keeps_its_peaks_and_its_gaps() -> None:
    values = np.zeros(50_000)
    values[31_234] = 7.0
    values[100:200] = np.nan
    figure = over_time("t", np.arange(50_000.0), [Curve("PV", "pv", values)], "PV")
    lines = [part.split('"')[0] for part in figure.split('points="')[1:]]
    assert len(lines) == 2
    points = [tuple(map(float, pair.split(","))) for line in lines for pair in line.split()]
    assert len(points) <= 1.2 * MOST
    assert min(y for _, y in points) < 0.1 * max(y for _, y in points)


def test_a_close_look_shows_pv_over_time_and_against_op() -> None:
    of = record()
    page = close_look(of, identification(of), UNITS)
    assert "About 4 cycles of 60 s on average, from the middle" in page
    assert "PV against OP." in page
    assert "Estimated stem of V1 against OP." in page
    assert page.count("<figure") == 4
    without = dataclasses.replace(identification(of), stem=np.empty((0, 1)))
    assert "estimated" not in close_look(of, without, UNITS)


def test_all_signals_have_one_figure_each() -> None:
    page = all_signals(record(), None, UNITS)
    assert page.count("<figure") == 2
    assert "PV1 (bar)" in page
    assert "set-point" in page
    assert "set-point" not in all_signals(dataclasses.replace(record(), sp=None), None, UNITS)


def test_a_plot_is_shown_and_saved_and_has_a_close_look_of_what_was_identified(
    tmp_path: Path,
) -> None:
    of = record()
    plain, seen = plot(of), plot(of, identification(of))
    assert (plain.page.count("<figure"), seen.page.count("<figure")) == (2, 6)
    assert "stem, estimated" in seen.page
    assert seen.save(tmp_path / "look.html").read_text(encoding="utf-8") == seen.page
    assert "<figure" not in seen._repr_html_()
    assert "&lt;figure" in seen._repr_html_()
    assert repr(seen) == "Figure()"
    with pytest.raises(InputError, match="samples, the record 50"):
        plot(of.part(0, 50), identification(of))
