"""Figures 1 and 4: the closed loop, and the stirred tank."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch, Polygon, Rectangle

from stiction_ros.processes.stirred_tank import TankParameters
from stiction_studies.drawing import BLUE, DPI, GREY, INK, ORANGE, PALE, WIDTH, Drawing, style
from stiction_studies.paper.exhibit import Exhibit, Row
from stiction_studies.paper.sources import Sources

_ARROW = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}


def figure1(sources: Sources) -> Exhibit:
    """Return the closed loop with sticky valves and process."""
    with style():
        figure, axis = _canvas(3.0, (0.0, 10.0), (0.0, 3.0))
        _box(axis, (1.3, 1.6), "MPC", "observer, target, (19)")
        _box(axis, (3.9, 1.6), "valves φ", "He's law (4)")
        _box(axis, (6.5, 1.6), "process", "ξ⁺ = A ξ + B χ,  C ξ")
        axis.add_patch(Circle((8.95, 1.95), 0.16, facecolor="white", edgecolor=INK, zorder=3))
        axis.text(8.95, 1.95, "+", ha="center", va="center", zorder=4)
        for start, end, name in (
            ((0.2, 1.95), (1.3, 1.95), "y_sp"),
            ((2.9, 1.95), (3.9, 1.95), "u"),
            ((5.5, 1.95), (6.5, 1.95), "χ"),
            ((8.1, 1.95), (8.79, 1.95), ""),
            ((9.11, 1.95), (9.9, 1.95), "y"),
        ):
            _arrow(axis, start, end, name)
        _arrow(axis, (8.95, 2.75), (8.95, 2.11), "v")
        axis.plot([9.5, 9.5, 2.1], [1.95, 0.6, 0.6], color=INK, linewidth=1.2)
        _arrow(axis, (2.1, 0.6), (2.1, 1.6), "")
        axis.text(5.8, 0.68, "y", ha="center", va="bottom")
        axis.add_patch(
            Rectangle((3.62, 1.3), 4.76, 1.15, fill=False, edgecolor=GREY, linestyle=(0, (4, 3)))
        )
        axis.text(6.0, 1.18, "z = (χ, ξ), (1) and (2)", ha="center", va="top", color=GREY)
    drawing = Drawing(
        "figure1",
        "Figure 1: the closed loop with sticky valves followed by the process",
        "u is OP, χ the stem, y PV, v white noise. The nodes controller and plant are its halves.",
        figure,
    )
    return Exhibit("figure1", drawing.title, (), drawing, "The same signals; own drawing.")


def figure4(sources: Sources) -> Exhibit:
    """Return the stirred tank with its two valves, and where it rests."""
    tank = TankParameters()
    with style():
        figure, axis = _canvas(4.4, (0.0, 10.0), (0.0, 4.6))
        axis.add_patch(Rectangle((3.4, 0.8), 3.2, 2.2, facecolor="#E3EEF6", edgecolor="none"))
        axis.plot([3.4, 3.4, 6.6, 6.6], [3.6, 0.8, 0.8, 3.6], color=INK, linewidth=1.6)
        axis.add_patch(Rectangle((3.1, 0.5), 3.8, 2.3, fill=False, edgecolor=ORANGE, linewidth=1.4))
        axis.plot([5.0, 5.0], [4.2, 1.5], color=GREY, linewidth=2.0)
        axis.plot([4.5, 5.5], [1.5, 1.5], color=GREY, linewidth=4.0)
        axis.text(4.2, 2.3, f"V = {tank.volume:g} m³\nC_out, T_out", ha="center", va="center")
        _arrow(axis, (0.6, 4.0), (1.6, 4.0), "")
        _valve(axis, (1.9, 4.0), "V1", "C")
        _arrow(axis, (2.2, 4.0), (3.9, 3.1), "")
        axis.text(0.5, 4.3, "stream A: F_A, C_A, T_A", ha="left", va="bottom")
        _arrow(axis, (9.4, 4.0), (6.1, 3.1), "")
        axis.text(9.5, 4.1, "stream B: F_B, C_B, T_B", ha="right", va="bottom")
        _arrow(axis, (0.6, 1.4), (1.6, 1.4), "")
        _valve(axis, (1.9, 1.4), "V2", "T")
        _arrow(axis, (2.2, 1.4), (3.1, 1.4), "")
        axis.text(0.5, 1.6, "steam W", ha="left", va="bottom")
        _arrow(axis, (6.9, 0.62), (7.9, 0.62), "")
        axis.text(8.0, 0.62, "condensate", ha="left", va="center")
        _arrow(axis, (6.6, 1.4), (9.4, 1.4), "")
        axis.text(9.5, 1.5, "F_out = F_A + F_B", ha="right", va="bottom")
    drawing = Drawing(
        "figure4",
        "Figure 4: the continuous stirred tank",
        "Valve 1 feeds stream A, valve 2 steam to the jacket (A.1); the level is held.",
        figure,
    )
    return Exhibit("figure4", drawing.title, _rest(sources), drawing, "Own drawing.")


def _rest(sources: Sources) -> tuple[Row, ...]:
    from stiction_ros.processes import StirredTank

    rows = []
    tank = StirredTank(("V1", "V2"))
    for stem, printed, remark in (
        (40.0, "equilibrium of the experiment for (A.3)", "F_A = 0.4 m³/min, W = 24 kg/min"),
        (50.0, "", "(A.3) has the gains of this one: deviations are taken about it"),
    ):
        level, heat = tank.steady_state(np.array([stem, stem]))
        ours = f"C {level:.3f} kg/m³, T {heat:.3f} °C"
        rows.append(Row(f"at rest with valves at ({stem:g}, {stem:g}) %", printed, ours, remark))
    return tuple(rows)


def _canvas(height: float, across: tuple[float, float], up: tuple[float, float]) -> Any:
    figure = Figure(figsize=(WIDTH, height), dpi=DPI, layout="constrained")
    axis = figure.subplots()
    axis.set_xlim(*across)
    axis.set_ylim(*up)
    axis.set_axis_off()
    axis.grid(visible=False)
    return figure, axis


def _box(axis: Any, corner: tuple[float, float], name: str, more: str) -> None:
    axis.add_patch(
        FancyBboxPatch(
            corner, 1.6, 0.7, boxstyle="round,pad=0,rounding_size=0.08", facecolor=PALE,
            edgecolor=INK, linewidth=1.0, alpha=0.6,
        )
    )  # fmt: skip
    x, y = corner[0] + 0.8, corner[1]
    axis.text(x, y + 0.46, name, ha="center", va="center", weight="bold")
    axis.text(x, y + 0.2, more, ha="center", va="center", fontsize=7.5)


def _arrow(axis: Any, start: tuple[float, float], end: tuple[float, float], name: str) -> None:
    axis.annotate("", end, start, arrowprops=_ARROW)
    if name:
        middle = 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
        upright = start[0] == end[0]
        axis.text(
            middle[0] + (0.08 if upright else 0.0),
            middle[1] + (0.0 if upright else 0.07),
            name,
            ha="left" if upright else "center",
            va="center" if upright else "bottom",
        )


def _valve(axis: Any, at: tuple[float, float], name: str, controlled: str) -> None:
    x, y = at
    for sign in (-1.0, 1.0):
        corners = [(x, y), (x + 0.3 * sign, y + 0.2), (x + 0.3 * sign, y - 0.2)]
        axis.add_patch(Polygon(corners, facecolor=BLUE, edgecolor=INK))
    axis.plot([x, x], [y, y - 0.45], color=INK)
    axis.text(x + 0.1, y - 0.5, f"{name}: u → χ", ha="center", va="top", fontsize=9)
    axis.text(x + 0.1, y - 0.75, f"moves {controlled}", ha="center", va="top", fontsize=8)
